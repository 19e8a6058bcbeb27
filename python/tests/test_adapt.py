"""A network adapted to a simulated street, through Python."""

import deepfusion
import numpy as np
import pytest

QUICK = {"model": "tiny", "steps": 2, "batch": 1, "simulated": 0, "held_out": 0.4}


@pytest.fixture(scope="session")
def street(tmp_path_factory):
    out = tmp_path_factory.mktemp("to-adapt-to")
    return deepfusion.simulate(out, frames=60, seed=90110, size=(320, 96), scan_every=0)


def test_a_network_that_gets_no_worse_is_kept_and_can_be_undone(street, tmp_path):
    events = []
    # Steps too small to change anything: the network stays as good as before.
    found = deepfusion.adapt(street, callback=events.append, out=tmp_path / "mine", learning_rate=1e-9, **QUICK)
    assert found.kept and found.worse == [] and found.path == tmp_path / "mine"
    assert (found.source, found.steps) == ("tiny", 2)
    reprojection = [when["without_truth"]["reprojection"]["warped"] for when in (found.before, found.after)]
    assert reprojection[1] == pytest.approx(reprojection[0], rel=1e-3)
    assert [event["step"] for event in events if event["event"] == "step"] == [1, 2]
    assert (found.path / "log.csv").is_file() and (found.path / "adapt.json").is_file()
    frame = deepfusion.Dataset(street)[0]
    depth = lambda model: deepfusion.load(model).predict(frame.image, frame.intrinsics).depth
    given = depth("tiny")
    assert not np.array_equal(found.load().predict(frame.image, frame.intrinsics).depth, given)
    found.undo()
    assert np.array_equal(depth(found.path), given)
    with pytest.raises(deepfusion.DeepFusionError, match="already undone"):
        found.undo()


def test_a_network_that_gets_worse_is_moved_aside(street, tmp_path):
    ruin = {"learning_rate_warmup_steps": 0}
    found = deepfusion.adapt(street, out=tmp_path / "mine", learning_rate=0.03, config=ruin, **QUICK)
    assert not found.kept and found.worse
    assert found.path == tmp_path / "mine.refused" and not (tmp_path / "mine").exists()


def test_a_stopped_adaptation_continues_with_the_same_call(street, tmp_path):
    def first_step(event):
        return event["event"] != "step"

    arguments = {**QUICK, "out": tmp_path / "mine", "learning_rate": 1e-9}
    with pytest.raises(deepfusion.DeepFusionError, match="1 of 2 steps") as stopped:
        deepfusion.adapt(street, callback=first_step, **arguments)
    assert "same call" in stopped.value.hint
    assert deepfusion.adapt(street, **arguments).steps == 2
    with pytest.raises(deepfusion.DeepFusionError, match="already exists"):
        deepfusion.adapt(street, **arguments)


def test_the_simulated_camera_is_the_drives_own_or_any(street, tmp_path):
    with pytest.raises(deepfusion.DeepFusionError, match='simulated_camera: expected "own" or "any", found "mine"'):
        deepfusion.adapt(street, out=tmp_path / "mine", **{**QUICK, "simulated_camera": "mine"})
