"""Predictions of many images, targets, arrays of other libraries, samples."""

import json
import pickle
import subprocess
import sys
from pathlib import Path

import deepfusion
import numpy as np
import pytest


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    out = tmp_path_factory.mktemp("traffic")
    return deepfusion.simulate(out, frames=6, seed=11, moving_cars=3, size=(640, 192), scan_every=2)


@pytest.fixture(scope="session")
def model():
    return deepfusion.load("tiny")


def test_many_images_give_the_same_as_one_at_a_time(drive, model, tmp_path):
    recording = deepfusion.Dataset(drive)
    camera = recording[0].intrinsics
    expected = [model.predict(frame.image, camera) for frame in recording]
    files = sorted((Path(drive) / "image_02" / "data").glob("*.png"))
    for images in [(frame.image for frame in recording), files * 4]:
        predictions = list(model.predict_many(images, camera))
        assert len(predictions) in (6, 24)
        for i, prediction in enumerate(predictions):
            assert np.array_equal(prediction.depth, expected[i % 6].depth)
            assert np.array_equal(prediction.disparity, expected[i % 6].disparity)
    assert list(model.predict_many([])) == []
    # An error of one image is raised at its turn; the others follow.
    (tmp_path / "broken.png").write_bytes(b"no picture")
    mixed = model.predict_many([files[0], tmp_path / "broken.png", files[1]], camera)
    assert np.array_equal(next(mixed).depth, expected[0].depth)
    with pytest.raises(deepfusion.DeepFusionError, match="broken.png"):
        next(mixed)
    assert np.array_equal(next(mixed).depth, expected[1].depth)
    with pytest.raises(StopIteration):
        next(mixed)
    with pytest.raises(TypeError, match="image"):
        next(model.predict_many([7]))


def test_a_broken_image_of_the_iterable_is_its_own_error(drive, model):
    def images():
        yield deepfusion.Dataset(drive)[0].image
        raise RuntimeError("the camera is gone")

    with pytest.raises(RuntimeError, match="camera is gone"):
        list(model.predict_many(images()))


def test_arrays_are_shared_and_not_copied(drive, model):
    frame = deepfusion.Dataset(drive)[0]
    image = frame.image
    prediction = model.predict(image, frame.intrinsics)
    for array in [image, prediction.depth, prediction.disparity, frame.ground_truth()]:
        assert np.shares_memory(np.from_dlpack(array), array)
    assert np.shares_memory(np.from_dlpack(prediction), prediction.depth)

    class Elsewhere:
        """Another library's array on the processor."""

        def __init__(self, array):
            self.array = array

        def __dlpack__(self, **options):
            return self.array.__dlpack__(**options)

        def __dlpack_device__(self):
            return self.array.__dlpack_device__()

    assert np.array_equal(model.predict(Elsewhere(image), frame.intrinsics).depth, prediction.depth)


def test_torch_shares_arrays(drive, model):
    torch = pytest.importorskip("torch")
    frame = deepfusion.Dataset(drive)[0]
    prediction = model.predict(torch.from_dlpack(frame.image), frame.intrinsics)
    depth = torch.from_dlpack(prediction)
    assert depth.data_ptr() == prediction.depth.ctypes.data
    assert np.array_equal(prediction.depth, model.predict(frame.image, frame.intrinsics).depth)


def test_targets_of_exact_depth(drive):
    frame = deepfusion.Dataset(drive)[0]
    simulated = deepfusion.perceive(frame_depth(drive, 0), frame.intrinsics, exact=True)
    assert simulated.ground.offset_m == pytest.approx(1.65, abs=0.1)
    assert np.allclose(simulated.ground.normal, (0, -1, 0), atol=0.05)
    assert simulated.targets, "a street is not empty"
    distances = [target.distance_m for target in simulated.targets]
    assert distances == sorted(distances)
    for target in simulated.targets:
        assert target.distance_m == pytest.approx(np.linalg.norm(target.center_m), rel=1e-9)
        assert np.allclose(target.corners_m.mean(axis=0), target.center_m)
        assert target.velocity_mps is None
    near = deepfusion.perceive(frame_depth(drive, 0), frame.intrinsics, exact=True, max_depth_m=15)
    assert all(target.center_m[2] < 17 for target in near.targets)
    met = deepfusion.Perception(exact=True).detect(
        frame_depth(drive, 0), frame.intrinsics, speed_mps=8.0, yaw_rate_radps=0.4
    )
    assert met.collision is not None and met.collision.id in {t.id for t in met.targets}
    # A camera that looks to the side does not see what the vehicle's front may hit.
    for yaw in (None, 1.2, -1.2, 3.0):
        aside = deepfusion.Perception(exact=True).detect(
            frame_depth(drive, 0), frame.intrinsics, speed_mps=8.0, yaw_rate_radps=0.4, camera_yaw_rad=yaw
        )
        assert aside.targets and aside.collision is None
    nothing = deepfusion.perceive(np.zeros((96, 320)), (160, 160, 160, 48))
    assert nothing.targets == [] and nothing.ground is None


def frame_depth(drive, index):
    from PIL import Image

    file = Path(drive) / "proj_depth/groundtruth/image_02" / f"{index:010}.png"
    return np.asarray(Image.open(file), dtype=np.float32) / 256


def test_targets_are_the_commands(drive, model, tmp_path):
    """Tracked over a drive, number for number."""
    out = tmp_path / "targets"
    arguments = ["perceive", drive, "--model", "tiny", "--out", str(out), "--save", "depth-png", "--quiet"]
    subprocess.run([sys.executable, "-m", "deepfusion", *arguments], check=True)
    lines = (out / "targets.jsonl").read_text().splitlines()
    recording, perception, pose = deepfusion.Dataset(drive), deepfusion.Perception(), np.eye(4)
    compared = 0
    for i, (frame, line) in enumerate(zip(recording, lines, strict=True)):
        theirs = json.loads(line)
        if i > 0:
            pose = pose @ recording.motion(i, i - 1)
        prediction = model.predict(frame.image, frame.intrinsics)
        ours = perception.detect(
            prediction.depth,
            frame.intrinsics,
            sigma=prediction.sigma,
            time_s=frame.time_s,
            world_from_cam=pose,
            speed_mps=frame.speed_mps,
            yaw_rate_radps=frame.yaw_rate_radps or 0.0,
            camera_yaw_rad=recording.camera_yaw_rad,
        )
        met = (theirs["collision_with"], theirs["time_to_collision_s"])
        if ours.collision is None:
            assert met == (None, None)
        else:
            assert (ours.collision.id, ours.collision.time_s) == (met[0], pytest.approx(met[1], abs=1e-6))
        assert [t.id for t in ours.targets] == [t["id"] for t in theirs["targets"]]
        for mine, other in zip(ours.targets, theirs["targets"]):
            assert np.allclose(mine.center_m, other["center_m"], atol=1e-6)
            assert np.allclose(mine.size_m, other["size_m"], atol=1e-6)
            assert mine.pixels == other["pixels"] and mine.moving == other["moving"]
            compared += 1
        if ours.ground is not None:
            assert np.allclose(ours.ground.normal, theirs["ground"]["normal"], atol=1e-6)
    assert compared > 0


def test_perception_says_what_is_wrong():
    depth, camera = np.ones((96, 320), np.float32), (160.0, 160.0, 160.0, 48.0)
    for settings, expected in [({"max_deth_m": 3}, "max_depth_m"), ({"min_pixels": "few"}, "few")]:
        with pytest.raises(deepfusion.DeepFusionError) as caught:
            deepfusion.perceive(depth, camera, **settings)
        assert expected in str(caught.value) + caught.value.hint
    deepfusion.perceive(depth, camera, max_depth_m=np.float32(30), min_pixels=np.int64(20))
    with pytest.raises(deepfusion.DeepFusionError, match="max_depth_m"):
        deepfusion.perceive(depth, camera, max_depth_m=-1)
    with pytest.raises(deepfusion.DeepFusionError, match="camera"):
        deepfusion.perceive(depth, (0.0, 1.0, 1.0, 1.0))
    with pytest.raises(deepfusion.DeepFusionError, match="pose"):
        deepfusion.Perception().detect(depth, camera, time_s=0.0)
    with pytest.raises(ValueError, match="rotation"):
        deepfusion.Perception().detect(depth, camera, time_s=0.0, world_from_cam=np.ones((4, 4)))


def test_snippets_are_of_neighbouring_frames(tmp_path):
    street = deepfusion.simulate(tmp_path, frames=6, seed=5, size=(96, 32), scan_every=0)
    (street / "image_02/data/0000000002.png").unlink()
    snippets = deepfusion.Snippets(street, offsets=(1,))
    assert [sample["number"] for sample in snippets] == [0, 3, 4]
    with pytest.raises(ValueError, match="camera"):
        deepfusion.Dataset(street, camera="both")


def test_snippets(drive):
    snippets = deepfusion.Snippets(drive, offsets=(-1, 1))
    assert len(snippets) == 4
    sample = snippets[0]
    assert sample["number"] == 1
    recording = deepfusion.Dataset(drive)
    assert np.array_equal(sample["image"], recording[1].image)
    assert sample["sources"].shape == (2, *sample["image"].shape)
    assert np.array_equal(sample["sources"][1], recording[2].image)
    # A point ahead is nearer in the next frame and farther in the previous one.
    ahead = sample["source_from_target"] @ (0, 0, 20, 1)
    assert ahead[1][2] < 20 < ahead[0][2]
    assert sample["intrinsics"][0, 2] == np.float32(recording[1].intrinsics[2])
    assert (sample["depth"] > 0).sum() == 0, "frame 1 has no scan"
    assert (snippets[1]["depth"] > 0).sum() > 100
    again = pickle.loads(pickle.dumps(snippets))
    assert len(again) == 4 and np.array_equal(again[2]["image"], snippets[2]["image"])


def test_torch_data_set(drive):
    torch = pytest.importorskip("torch")
    from deepfusion.torch import KittiLikeDataset

    data = KittiLikeDataset(drive, offsets=(1,))
    assert isinstance(data, torch.utils.data.Dataset) and len(data) == 5
    loader = torch.utils.data.DataLoader(data, batch_size=2, num_workers=1)
    batches = list(loader)
    assert [len(batch["number"]) for batch in batches] == [2, 2, 1]
    first = batches[0]
    assert first["image"].shape == (2, 3, 192, 640) and first["sources"].shape == (2, 1, 3, 192, 640)
    assert first["source_from_target"].shape == (2, 1, 4, 4) and first["depth"].shape == (2, 1, 192, 640)
    image = deepfusion.Dataset(drive)[0].image
    assert np.array_equal((first["image"][0] * 255).round().byte().permute(1, 2, 0).numpy(), image)


def test_without_torch_it_says_what_to_install():
    program = "import sys; sys.modules['torch'] = None\nimport deepfusion\nimport deepfusion.torch"
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert ended.returncode != 0 and "pip install torch" in ended.stderr
