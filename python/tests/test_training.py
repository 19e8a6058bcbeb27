"""Training on a simulated street, through Python."""

import os
import shutil
import signal
import subprocess
import sys
import textwrap
import threading
import time

import deepfusion
import numpy as np
import pytest

SMALL = {"preset": "tiny", "steps": 3, "batch": 2, "size.width": 64, "size": {"height": 64}, "seed": 4, "validation_share": 0.2}


@pytest.fixture(scope="session")
def street(tmp_path_factory):
    out = tmp_path_factory.mktemp("to-learn-from")
    return deepfusion.simulate(out, frames=12, seed=3, size=(320, 96))


@pytest.fixture(scope="session")
def run(street, tmp_path_factory):
    """A run and its events."""
    events = []
    folder = tmp_path_factory.mktemp("runs") / "run"
    run = deepfusion.train(SMALL, street, events.append, out=folder, init="none")
    return run, events


def test_a_run_is_trained_and_can_be_loaded(run, street):
    run, events = run
    assert (run.step, run.steps, run.stopped) == (3, 3, False)
    assert np.isfinite(run.losses["total"]) and run.losses["reprojection"] > 0
    assert {"config.toml", "last.safetensors", "log.csv"} <= set(os.listdir(run.path))
    kinds = [event["event"] for event in events]
    assert kinds[0] == "started" and kinds.count("step") == 3 and "saved" in kinds
    assert events[0]["steps"] == 3 and events[0]["samples"] > 0
    steps = [event for event in events if event["event"] == "step"]
    assert [event["step"] for event in steps] == [1, 2, 3]
    assert steps[-1]["losses"] == run.losses
    # The same as the command's log.
    lines = (run.path / "log.csv").read_text().splitlines()
    columns = lines[0].split(",")
    last = dict(zip(columns, [line for line in lines if ",train," in line][-1].split(",")))
    assert float(last["total"]) == pytest.approx(run.losses["total"], abs=1e-8)
    model = run.load()
    assert model.size == (64, 64) and model.step == 3
    frame = deepfusion.Dataset(street)[0]
    assert np.isfinite(model.predict(frame.image, frame.intrinsics).depth).all()


def test_a_run_leaves_what_the_command_leaves(run):
    path = run[0].path
    assert any(name.startswith("events.out.tfevents") for name in os.listdir(path))
    assert (path / "panels" / "000003.png").is_file()


def test_the_same_seed_is_the_same_run(run, street, tmp_path):
    again = deepfusion.train(SMALL, [street], out=tmp_path / "again", init="none")
    assert again.losses == run[0].losses
    other = deepfusion.train({**SMALL, "seed": 5}, street, out=tmp_path / "other", init="none")
    assert other.losses != run[0].losses


def test_a_recordings_warnings_are_python_warnings(street, tmp_path):
    """As the command prints them."""
    folder = tmp_path / "folder"
    frames = list(deepfusion.Dataset(street))
    shutil.copytree(street / "image_02" / "data", folder / "images")
    (folder / "frames.csv").write_text("time_s,file\n" + "".join(f"{f.time_s:.6f},{f.number:010}.png\n" for f in frames))
    speeds = "".join(f"{f.time_s:.6f},{f.speed_mps},{f.yaw_rate_radps or 0.0}\n" for f in frames)
    (folder / "speed.csv").write_text("time_s,speed_mps,yaw_rate_radps\n" + speeds)
    (folder / "intrinsics.txt").write_text(" ".join(map(str, frames[0].intrinsics)))
    with pytest.warns(UserWarning, match="folder"):
        deepfusion.train({**SMALL, "steps": 1}, folder, out=tmp_path / "run", init="none")


def test_a_callback_stops_and_the_run_can_be_resumed(run, street, tmp_path):
    out = tmp_path / "stopped"
    stopped = deepfusion.train(
        SMALL, street, lambda e: not (e["event"] == "step" and e["step"] == 2), out=out, init="none"
    )
    assert stopped.stopped and stopped.step == 2
    finished = deepfusion.train(out=out, resume=True)
    assert finished.step == 3 and not finished.stopped
    # The result is as without the interruption.
    assert finished.losses["total"] == pytest.approx(run[0].losses["total"], rel=1e-5)


def test_what_a_callback_raises_is_raised(street, tmp_path):
    class Mine(Exception):
        pass

    def listen(event):
        if event["event"] == "step":
            raise Mine("enough")

    out = tmp_path / "raised"
    with pytest.raises(Mine, match="enough"):
        deepfusion.train(SMALL, street, listen, out=out, init="none")
    assert deepfusion.load(out).step == 1, "the run is saved"


def test_false_stops_whatever_the_event_is(street, tmp_path):
    out = tmp_path / "early"
    stopped = deepfusion.train(
        {**SMALL, "steps": 50, "validate_every": 2}, street, lambda e: e["event"] != "validated", out=out, init="none"
    )
    assert stopped.stopped and stopped.step == 3


def test_a_run_is_resumed_with_its_own_settings(run, street, tmp_path):
    """As in the command: a run may be made longer; contradictions are errors that leave it unchanged."""
    out = tmp_path / "run"
    shutil.copytree(run[0].path, out)
    before = (out / "config.toml").read_text()
    for config, options in [
        ({"depth_net.encoder.depth": "resnet50"}, {}),
        ({"batch": 8}, {}),
        ({"loss": {"smoothness": 0.0}}, {}),
        ("light", {}),
        ({"preset": "light"}, {}),
        ({"steps": 2}, {}),
        ({}, {"init": "street"}),
    ]:
        with pytest.raises(deepfusion.DeepFusionError) as caught:
            deepfusion.train(config, out=out, resume=True, **options)
        assert caught.value.hint, caught.value
        assert (out / "config.toml").read_text() == before
    longer = deepfusion.train({"steps": 4}, street, out=out, resume=True)
    assert longer.step == longer.steps == 4


def test_a_callback_may_predict(street, tmp_path):
    """Even with a single thread, as Ray gives each worker."""
    code = """
        import sys, deepfusion
        model, seen = deepfusion.load("tiny"), []
        frame = deepfusion.Dataset(sys.argv[1])[0]
        def listen(event):
            if event["event"] == "step":
                seen.append(len(list(model.predict_many([frame.image] * 3, frame.intrinsics))))
                model.predict(frame.image, frame.intrinsics)
        config = {"preset": "tiny", "steps": 2, "batch": 1, "size": {"width": 64, "height": 64}, "validation_share": 0.2}
        deepfusion.train(config, sys.argv[1], listen, out=sys.argv[2], init="none")
        assert seen == [3, 3]
    """
    words = [sys.executable, "-c", textwrap.dedent(code), str(street), str(tmp_path / "run")]
    subprocess.run(words, check=True, timeout=120, env={**os.environ, "RAYON_NUM_THREADS": "1"})


def test_the_interpreter_is_free_meanwhile(street, tmp_path):
    counted = []
    done = threading.Event()

    def count():
        while not done.is_set():
            counted.append(time.monotonic())
            time.sleep(0.01)

    thread = threading.Thread(target=count)
    thread.start()
    try:
        deepfusion.train(SMALL, street, out=tmp_path / "run", init="none")
    finally:
        done.set()
        thread.join()
    assert len(counted) > 10


def test_wrong_configurations_say_what_is_wrong(run, street, tmp_path):
    def wrong(*arguments, **options):
        with pytest.raises(deepfusion.DeepFusionError) as caught:
            deepfusion.train(*arguments, **{"out": tmp_path / "none", **options})
        assert caught.value.hint, caught.value
        return str(caught.value) + caught.value.hint

    assert "light" in wrong("lihgt", street)
    assert "batsch" in wrong({"batsch": 3}, street)
    assert "many" in wrong({"batch": "many"}, street)
    assert "no recordings to train on" in wrong("tiny")
    assert "nowhere" in wrong("tiny", tmp_path / "nowhere")
    assert "no-such-network" in wrong(SMALL, street, init="no-such-network")
    assert "not empty" in wrong(SMALL, street, out=run[0].path)
    with pytest.raises(TypeError, match="configuration"):
        deepfusion.train({"batch": object()}, street, out=tmp_path / "none")
    assert not (tmp_path / "none").exists()


def interrupted(code, when, *arguments):
    """Runs a program and sends Ctrl-C once it has printed `when`; returns how it ended, and how long that took."""
    program = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code), *map(str, arguments)],
        stdout=subprocess.PIPE,
        text=True,
        # Processes that a shell starts in the background ignore Ctrl-C, and the program would inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    for line in program.stdout:
        if line.strip() == when:
            break
    start = time.monotonic()
    program.send_signal(signal.SIGINT)
    rest = program.stdout.read()
    return program.wait(timeout=120), rest, time.monotonic() - start


@pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")
def test_ctrl_c_ends_training_and_keeps_it(street, tmp_path):
    out = tmp_path / "interrupted"
    code = """
        import sys, deepfusion
        config = {"preset": "tiny", "steps": 100000, "batch": 2, "size": {"width": 64, "height": 64}, "validation_share": 0.2}
        def listen(event):
            if event["event"] == "step" and event["step"] == 2:
                print("two", flush=True)
        try:
            deepfusion.train(config, sys.argv[1], listen, out=sys.argv[2], init="none")
        except KeyboardInterrupt:
            print("interrupted", flush=True)
    """
    code, rest, seconds = interrupted(code, "two", street, out)
    assert code == 0 and "interrupted" in rest
    assert seconds < 60
    assert deepfusion.load(out).step >= 2
    more = deepfusion.train({"steps": deepfusion.load(out).step + 1}, out=out, resume=True)
    assert more.step == more.steps


@pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")
def test_ctrl_c_ends_other_long_calls(street, tmp_path):
    out = tmp_path / "drive"
    code = """
        import sys, deepfusion
        try:
            print("begun", flush=True)
            deepfusion.simulate(sys.argv[1], frames=3000, size=(320, 96))
        except KeyboardInterrupt:
            print("interrupted", flush=True)
    """
    code, rest, seconds = interrupted(code, "begun", out)
    assert code == 0 and "interrupted" in rest and seconds < 60
    assert not out.exists(), "no incomplete output is left"
    code = """
        import itertools, sys, deepfusion
        frame = deepfusion.Dataset(sys.argv[1])[0]
        model = deepfusion.load("tiny")
        try:
            print("begun", flush=True)
            for prediction in model.predict_many(itertools.repeat(frame.image), frame.intrinsics):
                pass
        except KeyboardInterrupt:
            print("interrupted", flush=True)
    """
    code, rest, seconds = interrupted(code, "begun", street)
    assert code == 0 and "interrupted" in rest and seconds < 20


@pytest.mark.skipif(os.name != "posix", reason="makes a pipe, sends SIGINT")
@pytest.mark.parametrize("call", ["Dataset", "load"])
def test_ctrl_c_ends_long_reading(run, street, tmp_path, call):
    """A file that never arrives simulates a large recording, or weights on a slow disk."""
    if call == "Dataset":
        date = tmp_path / street.parent.name
        given = date / street.name
        shutil.copytree(street, given)
        for calibration in street.parent.glob("*.txt"):
            shutil.copy(calibration, date)
        slow = given / "image_02" / "timestamps.txt"
        slow.unlink()
    else:
        given = tmp_path
        shutil.copy(run[0].path / "config.toml", given)
        slow = given / "last.safetensors"
    os.mkfifo(slow)
    code = f"""
        import os, signal, sys, threading
        import deepfusion
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
        try:
            deepfusion.{call}(sys.argv[1])
        except KeyboardInterrupt:
            print("interrupted")
    """
    ended = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), str(given)],
        capture_output=True,
        text=True,
        timeout=60,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert (ended.returncode, ended.stdout) == (0, "interrupted\n"), ended.stderr
