"""The package on simulated streets, whose depth is known."""

import ast
import inspect
import json
import os
import pickle
import shutil
import signal
import subprocess
import sys
import sysconfig
import textwrap
import threading
import warnings
from pathlib import Path

import deepfusion
import numpy as np
import pytest
from PIL import Image


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    out = tmp_path_factory.mktemp("street")
    return deepfusion.simulate(out, frames=3, seed=5, moving_cars=2, size=(320, 96), scan_every=2)


@pytest.fixture(scope="session")
def model():
    return deepfusion.load("tiny")


def test_a_varied_drive_has_a_camera_of_its_own(tmp_path):
    cameras = []
    for seed in (1, 2):
        drive = deepfusion.simulate(tmp_path / f"{seed}", frames=1, seed=seed, scene="country", varied=True, size=(96, 64), scan_every=0)
        camera = json.loads((drive / "varied.json").read_text())["camera"]
        assert deepfusion.Dataset(drive)[0].intrinsics[0] == pytest.approx(camera["intrinsics"]["fx"])
        assert 0.3 <= camera["height_m"] <= 2.5
        cameras.append(camera)
    assert cameras[0] != cameras[1]
    with pytest.raises(deepfusion.DeepFusionError, match="only varied drives have this scene") as refused:
        deepfusion.simulate(tmp_path / "plain", frames=1, scene="country")
    assert "varied" in refused.value.hint


def test_networks_are_in_the_package():
    assert {"street", "tiny"} <= set(deepfusion.networks())
    assert deepfusion.__version__.count(".") == 2


def test_image_to_metres(drive, model):
    frame = deepfusion.Dataset(drive)[0]
    prediction = model.predict(frame.image, frame.intrinsics)
    depth = prediction.depth
    assert depth.shape == frame.image.shape[:2] and depth.dtype == np.float32
    assert np.isfinite(depth).all() and depth.min() > 0
    assert prediction.depth is depth, "one array, made once"
    xyz, rgb = prediction.cloud(max_depth=40)
    assert xyz.shape == rgb.shape and xyz.shape[1] == 3
    assert len(xyz) == (depth <= 40).sum()
    # Row by row: z is the depth itself.
    assert np.array_equal(xyz[:, 2], depth[depth <= 40])
    assert np.array_equal(rgb, frame.image[depth <= 40])
    # Pixels removed from the depth are not in the cloud.
    depth[len(depth) // 2 :] = 0
    assert len(prediction.cloud(max_depth=40)[0]) == ((depth > 0) & (depth <= 40)).sum() < len(xyz)


def test_arrays_are_made_once(drive):
    frame = deepfusion.Dataset(drive)[0]
    seen = deepfusion.load("street").predict(frame.image, frame.intrinsics)
    for name in ["depth", "sigma", "confidence", "disparity"]:
        assert getattr(seen, name) is getattr(seen, name), name


def test_the_confidence_of_a_pixel(drive, model):
    """exp(-expected error), computed from the standard deviation."""
    frame = deepfusion.Dataset(drive)[0]
    seen = deepfusion.load("street").predict(frame.image, frame.intrinsics)
    inside = seen.depth > 0
    expected = np.exp(-seen.sigma[inside] / (np.sqrt(2) * seen.depth[inside]))
    assert np.allclose(seen.confidence[inside], expected, atol=1e-6)
    assert np.all(seen.confidence[~inside] == 0) and seen.confidence.dtype == np.float32
    assert model.predict(frame.image, frame.intrinsics).confidence is None


def test_sigma_is_the_commands(drive, tmp_path):
    """`street` has factors that scale its predicted sigma."""
    command = os.environ.get("DEEPFUSION") or str(Path(sysconfig.get_path("scripts")) / "deepfusion")
    frame = deepfusion.Dataset(drive)[0]
    out = tmp_path / "sure"
    subprocess.run([command, "predict", drive, "--model", "street", "--save", "sigma,confidence", "--out", out, "--quiet"], check=True)
    seen = deepfusion.load("street").predict(frame.image, frame.intrinsics)
    for what, ours in [("sigma", seen.sigma), ("confidence", seen.confidence)]:
        assert np.array_equal(np.load(sorted(out.glob(f"*_{what}.npy"))[0]), ours), what


def test_an_object_that_is_no_image_raises_at_its_turn(drive, model):
    frame = deepfusion.Dataset(drive)[0]
    predictions = model.predict_many([frame.image, frame.image, 7, frame.image], frame.intrinsics)
    assert next(predictions).depth.shape == next(predictions).depth.shape
    with pytest.raises(TypeError, match="image"):
        next(predictions)
    assert len(list(predictions)) == 1

    def failing():
        yield frame.image
        raise KeyError("gone")

    predictions = model.predict_many(failing(), frame.intrinsics)
    next(predictions)
    with pytest.raises(KeyError, match="gone"):
        next(predictions)


def test_a_phones_picture_is_upright(drive, model, tmp_path):
    """EXIF's orientation 6: the camera was upright, but the pixels are rotated."""
    picture = Image.fromarray(deepfusion.Dataset(drive)[0].image)
    exif = Image.Exif()
    exif[0x0112] = 6
    file = tmp_path / "upright.jpg"
    picture.save(file, exif=exif, quality=95)
    from_file = model.predict(file, (300, 300, 60, 200))
    with Image.open(file) as opened:
        from_pil = model.predict(opened, (300, 300, 60, 200))
    assert from_file.depth.shape == from_pil.depth.shape == (picture.width, picture.height)
    # Decoders may differ by 1 of 255.
    assert np.median(np.abs(np.log(from_file.depth / from_pil.depth))) < 0.02


def test_a_camera_is_four_numbers_or_a_matrix(drive, model):
    frame = deepfusion.Dataset(drive)[0]
    fx, fy, cx, cy = frame.intrinsics
    k = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    expected = model.predict(frame.image, frame.intrinsics)
    for given in (k, k.tolist(), np.array(frame.intrinsics)):
        seen = model.predict(frame.image, given)
        assert seen.intrinsics == expected.intrinsics and np.array_equal(seen.depth, expected.depth)
    assert np.array_equal(next(iter(model.predict_many([frame.image], k))).depth, expected.depth)
    found, again = (deepfusion.perceive(expected.depth, given).ground for given in (frame.intrinsics, k))
    assert found == again
    k[0, 1] = 2.0
    with pytest.raises(deepfusion.DeepFusionError, match="not the matrix of a pinhole camera") as refused:
        model.predict(frame.image, k)
    assert "0 0 1" in refused.value.hint


def test_a_picture_that_pil_opened_has_its_lens(drive, model, tmp_path):
    picture = Image.fromarray(deepfusion.Dataset(drive)[0].image)
    exif = Image.Exif()
    exif[0x0112] = 1
    exif.get_ifd(0x8769)[0xA405] = 26
    for name in ("lens.jpg", "lens.png"):
        file = tmp_path / name
        picture.save(file, exif=exif)
        with Image.open(file) as opened:
            assert model.predict(opened).intrinsics == model.predict(file).intrinsics
            assert model.predict(opened).intrinsics is not None
            # After cropping, the focal length is wrong.
            assert model.predict(opened.crop((0, 0, 96, 64))).intrinsics is None


def test_every_kind_of_image_is_the_same_image(drive, model, tmp_path):
    frame = deepfusion.Dataset(drive)[1]
    expected = model.predict(frame.image, frame.intrinsics).depth
    picture = Image.fromarray(frame.image)
    file = tmp_path / "street.png"
    picture.save(file)
    for same in [picture, file, str(file), np.asfortranarray(frame.image)]:
        assert np.array_equal(model.predict(same, frame.intrinsics).depth, expected)
    mirrored = model.predict(frame.image[:, ::-1], frame.intrinsics).depth
    assert not np.array_equal(mirrored, expected)


def test_sixteen_bits_are_eight_as_in_a_file(drive, model, tmp_path):
    """PIL's own conversion would make nearly all pixels white."""
    frame = deepfusion.Dataset(drive)[0]
    grey = frame.image.mean(axis=2) * 257
    file = tmp_path / "grey.png"
    Image.fromarray(grey.astype(np.uint16)).save(file)
    with Image.open(file) as opened:
        if not opened.mode.startswith("I;16"):
            pytest.skip("this Pillow reads 16 bits as 32")
        assert np.array_equal(model.predict(opened, frame.intrinsics).depth, model.predict(file, frame.intrinsics).depth)
    for values in [grey.astype(np.int32), grey.astype(np.float32)]:
        with pytest.raises(TypeError, match="no fixed range"):
            model.predict(Image.fromarray(values), frame.intrinsics)


def test_a_recording(drive):
    recording = deepfusion.Dataset(drive)
    assert len(recording) == 3 and recording.layout == "KITTI raw"
    frames = list(recording)
    assert [frame.number for frame in frames] == [0, 1, 2]
    assert frames[0].time_s < frames[1].time_s and frames[0].speed_mps > 0
    assert recording[-1].number == 2
    with pytest.raises(IndexError):
        recording[3]
    # The camera moves forward, so points ahead come nearer.
    motion = recording.motion(0, 1)
    distance = np.linalg.norm(motion[:3, 3])
    assert motion[2, 3] < 0 and 0.1 < distance < 3
    assert np.allclose(motion @ recording.motion(1, 0), np.eye(4), atol=1e-6)
    assert recording.camera_yaw_rad == pytest.approx(0, abs=0.05)
    assert frames[0].yaw_rate_radps is None and abs(frames[1].yaw_rate_radps) < 1
    # The scan is exact, and only every second frame has one.
    truth = frames[0].ground_truth()
    assert truth.shape == frames[0].image.shape[:2] and (truth > 0).sum() > 100
    assert frames[1].ground_truth() is None


def test_a_recording_is_a_sequence(drive, tmp_path):
    recording = deepfusion.Dataset(drive)
    assert [frame.number for frame in recording[1:]] == [1, 2] and recording[3:] == []
    assert [frame.number for frame in recording[::-2]] == [2, 0] and recording[np.int64(1)].number == 1
    assert np.array_equal(recording.motion(-1, 0), recording.motion(2, 0))
    for wrong in (3, -4):
        with pytest.raises(IndexError):
            recording.motion(wrong, 0)
    assert recording.numbers.tolist() == [0, 1, 2] and recording.numbers.dtype == np.int64
    assert recording.times_s.tolist() == [frame.time_s for frame in recording]
    assert recording.speeds_mps.tolist() == [frame.speed_mps for frame in recording]
    frame = recording[0]
    fx, fy, cx, cy = frame.intrinsics
    assert frame.K.tolist() == [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]
    assert frame == recording[0] == deepfusion.Dataset(drive)[0] and hash(frame) == hash(recording[0])
    assert frame != recording[1] and frame != "frame" and len({frame, recording[-3], recording[1]}) == 2
    assert repr(frame).startswith("Frame(0 of") and repr(recording).startswith("Dataset(")
    again = deepfusion.drives(drive)
    assert [one.name for one in again] == [recording.name]
    other = deepfusion.simulate(tmp_path / "other", frames=2, size=(320, 96), scan_every=0)
    shutil.copytree(drive.parent, tmp_path / "both" / drive.parent.name)
    both = tmp_path / "both" / drive.parent.name
    shutil.copytree(other, both / f"{other.name[:-9]}0077_sync")
    opened = deepfusion.drives(both)
    assert [len(one) for one in opened] == [3, 2]
    assert [pickle.loads(pickle.dumps(one)).name for one in opened] == [one.name for one in opened]


def test_a_frame_is_an_image(drive, model):
    recording = deepfusion.Dataset(drive)
    for frame, seen in zip(recording, model.predict_many(recording, ahead=1), strict=True):
        expected = model.predict(frame.image, frame.intrinsics)
        assert np.array_equal(seen.depth, expected.depth) and seen.intrinsics == expected.intrinsics
        assert np.array_equal(model.predict(frame).depth, expected.depth)
    other = model.predict(frame, (100, 100, 160, 48))
    assert other.intrinsics == (100, 100, 160, 48) and not np.array_equal(other.depth, expected.depth)


def test_a_field_of_view_is_a_camera(drive, model):
    frame = deepfusion.Dataset(drive)[0]
    width = frame.image.shape[1]
    fx, fy, cx, cy = model.predict(frame.image, hfov_deg=90).intrinsics
    assert fx == pytest.approx(width / 2) and fy == fx and cx == pytest.approx((width - 1) / 2)
    assert next(model.predict_many([frame], hfov_deg=90)).intrinsics == (fx, fy, cx, cy)
    for wrong in [{"hfov_deg": 190}, {"hfov_deg": 90, "intrinsics": frame.intrinsics}]:
        with pytest.raises(ValueError, match="hfov_deg"):
            model.predict(frame, **wrong)


def test_an_unknown_camera_gives_one_warning(drive):
    model = deepfusion.load("tiny")
    image = deepfusion.Dataset(drive)[0].image
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.predict(image, (100, 100, 160, 48))
        with pytest.raises(UserWarning, match="hfov_deg"):
            model.predict(image)
        model.predict(image)
        list(model.another().predict_many([image]))


def test_what_a_recording_lacks_can_be_given(drive, tmp_path):
    folder = folder_of(drive, tmp_path / "folder")
    (folder / "intrinsics.txt").unlink()
    with pytest.raises(deepfusion.DeepFusionError):
        deepfusion.Dataset(folder)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plain = deepfusion.Dataset(folder, hfov_deg=90)
        assert plain[0].intrinsics[0] == pytest.approx(160)
        camera = (200.0, 200.0, 160.0, 48.0)
        later = deepfusion.Dataset(folder, intrinsics=camera, clock_offset_ms=10)
        assert later[0].intrinsics == camera
        again = pickle.loads(pickle.dumps(later))
        assert again[0].intrinsics == camera and again[0].time_s == later[0].time_s
        split = tmp_path / "split.txt"
        split.write_text(f"{folder.name} 1 l\n")
        assert [frame.number for frame in deepfusion.Dataset(folder, hfov_deg=90, split=split)] == [1]
        assert deepfusion.drives(folder, hfov_deg=90)[0][0].intrinsics == plain[0].intrinsics
        report = deepfusion.doctor(folder, hfov_deg=90)
        assert report["drives"][0]["frames"] == 3
        assert deepfusion.doctor(folder)["drives"] == []
    for wrong, expected in [
        ({"topics": {"image": ""}}, "topics"),
        ({"topics": {"pictures": "/a"}}, "unknown role"),
        ({"hfov_deg": 90, "intrinsics": camera}, "hfov_deg"),
    ]:
        with pytest.raises(ValueError, match=expected):
            deepfusion.Dataset(folder, **wrong)
    with pytest.raises(TypeError, match="topics"):
        deepfusion.Dataset(folder, topics=["image"])
    # Only bags have topics.
    with pytest.raises(deepfusion.DeepFusionError):
        deepfusion.Dataset(folder, hfov_deg=90, topics={"image": "/camera"})


def test_a_log_by_itself(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("time_s,speed_mps\n" + "".join(f"{i / 10},{5 + i % 7}\n" for i in range(200)))
    printed = subprocess.run([sys.executable, "-m", "deepfusion", "doctor", str(log), "--json"], capture_output=True, check=False)
    assert deepfusion.doctor(log) == json.loads(printed.stdout)
    with pytest.raises(deepfusion.DeepFusionError, match="no camera"):
        deepfusion.doctor(log, hfov_deg=90)


def test_objects_that_can_be_reopened_are_pickled(drive, model, monkeypatch, tmp_path):
    monkeypatch.chdir(Path(drive).parent)
    recording = deepfusion.Dataset(Path(drive).name)
    text = pickle.dumps((recording, recording[1], recording[2], model))
    # Whatever the other process's current folder.
    monkeypatch.chdir(tmp_path)
    again, frame, last, network = pickle.loads(text)
    assert again.name == recording.name and (frame, last) == (recording[1], recording[2])
    expected = model.predict(recording[1]).depth
    assert np.array_equal(network.predict(frame).depth, expected)
    seen = model.predict(recording[0])
    with pytest.raises(TypeError, match="prediction.depth"):
        pickle.dumps(seen)
    assert repr(model).startswith('Model("tiny", 320 x 96') and repr(seen) == "Prediction(96 x 320, camera known)"
    assert np.asarray(seen) is seen.depth or np.shares_memory(np.asarray(seen), seen.depth)
    assert np.array(seen, dtype=np.float64).dtype == np.float64


def test_ctrl_c_in_the_callers_generator_ends_at_once(drive, model):
    image = deepfusion.Dataset(drive)[0].image

    def images():
        yield image
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        next(model.predict_many(images(), (100, 100, 160, 48)))


def test_one_thread_takes_predictions(drive, model):
    image = deepfusion.Dataset(drive)[0].image
    waits, goes_on = threading.Event(), threading.Event()

    def images():
        waits.set()
        goes_on.wait(60)
        yield image

    predictions = model.predict_many(images(), (100, 100, 160, 48))
    taken = []
    thread = threading.Thread(target=lambda: taken.append(next(predictions)))
    thread.start()
    waits.wait(60)
    try:
        with pytest.raises(RuntimeError, match="another thread"):
            next(predictions)
    finally:
        goes_on.set()
        thread.join()
    assert len(taken) == 1
    with pytest.raises(ValueError, match="ahead"):
        model.predict_many([], ahead=0)


def test_an_array_that_is_no_image_says_how_to_convert_it(drive, model):
    image = deepfusion.Dataset(drive)[0].image
    for wrong, expected in [
        (image / np.float32(255), "found float32 96 x 320 x 3.*astype"),
        (image[..., 0], "96 x 320: for grey"),
        (np.dstack([image, image[..., :1]]), r"96 x 320 x 4: give image\[\.\.\., :3\]"),
        (image.transpose(2, 0, 1), "transpose"),
        (image[None], "predict_many"),
    ]:
        with pytest.raises((TypeError, ValueError), match=expected):
            model.predict(wrong)
    with pytest.raises(TypeError, match="3 x 3 matrix"):
        model.predict(image, "the camera")
    fx, fy, cx, cy = camera = deepfusion.Dataset(drive)[0].intrinsics
    p = np.array([[fx, 0, cx, 0], [0, fy, cy, 0], [0, 0, 1, 0]])
    assert model.predict(image, p).intrinsics == camera
    p[0, 3] = -380
    with pytest.raises(deepfusion.DeepFusionError, match="last column") as refused:
        model.predict(image, p)
    assert "P[:, :3]" in refused.value.hint


def folder_of(drive, out):
    """The same images as a plain folder with speeds, without the camera's mount."""
    frames = list(deepfusion.Dataset(drive))
    shutil.copytree(Path(drive) / "image_02" / "data", out / "images")
    (out / "frames.csv").write_text("time_s,file\n" + "".join(f"{f.time_s:.6f},{f.number:010}.png\n" for f in frames))
    speeds = "".join(f"{f.time_s:.6f},{f.speed_mps},{f.yaw_rate_radps or 0.0}\n" for f in frames)
    (out / "speed.csv").write_text("time_s,speed_mps,yaw_rate_radps\n" + speeds)
    (out / "intrinsics.txt").write_text(" ".join(map(str, frames[0].intrinsics)))
    return out


def test_doubts_about_a_recording_are_warnings(drive, tmp_path):
    folder = folder_of(drive, tmp_path / "folder")
    with pytest.warns(UserWarning, match="straight ahead"):
        recording = deepfusion.Dataset(folder)
    assert any("straight ahead" in warning for warning in recording.warnings)
    assert all(warning.startswith(str(folder)) for warning in recording.warnings)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert deepfusion.Dataset(drive).warnings == []
        with pytest.raises(UserWarning, match="folder"):
            deepfusion.Dataset(folder)


def test_the_metrics_are_the_usual_ones():
    rng = np.random.default_rng(3)
    truth = rng.uniform(1, 70, (20, 30))
    truth[rng.random(truth.shape) < 0.5] = 0
    predicted = np.where(truth > 0, truth, 5) * rng.uniform(0.8, 1.3, truth.shape)
    report = deepfusion.evaluate([predicted], [truth])
    known = truth > 0
    error = np.abs(predicted[known].clip(1e-3, 80) - truth[known])
    assert report["unscaled"]["abs_rel"] == pytest.approx((error / truth[known]).mean(), rel=1e-9)
    assert report["unscaled"]["rmse"] == pytest.approx(np.sqrt((error**2).mean()), rel=1e-9)
    ratio = np.median(truth[known]) / np.median(predicted[known])
    assert report["scale"]["median"] == pytest.approx(ratio, rel=1e-9)
    inverse = deepfusion.evaluate([1 / predicted], [truth], kind="disparity")
    assert inverse["unscaled"]["abs_rel"] == pytest.approx(report["unscaled"]["abs_rel"], rel=1e-6)


def test_pixels_without_a_prediction_can_be_left_out():
    """`Prediction.depth` is 0 outside of the part that the network saw."""
    truth = np.full((4, 6), 10.0)
    predicted = np.full((4, 6), 11.0)
    predicted[:2] = 0
    with pytest.raises(deepfusion.DeepFusionError, match="12 of 24") as refused:
        deepfusion.evaluate([predicted], [truth])
    assert "allow_holes=True" in refused.value.hint
    report = deepfusion.evaluate([predicted], [truth], allow_holes=True, gt_depth="annotated", scale=0.5, points=4)
    assert report["unscaled"]["abs_rel"] == pytest.approx(0.1) and report["missing_rate"] > 0
    assert report["protocol"]["gt"] == "annotated"
    assert report["fixed_scaled"]["factor"] == 0.5 and report["points"] is not None
    with pytest.raises(ValueError, match="gt_depth"):
        deepfusion.evaluate([predicted], [truth], gt_depth="lidar")
    with pytest.raises(ValueError, match="1 x 4 x 6"):
        deepfusion.evaluate([predicted[None]], [truth])


def test_columns_of_records_are_measured():
    """Their numbers are not contiguous."""
    truth = np.linspace(2, 30, 24).reshape(4, 6)
    records = np.zeros((4, 6), dtype=[("z", "<f8"), ("ok", "u1")])
    records["z"] = 1.1 * truth
    report = deepfusion.evaluate([records["z"]], [truth])
    assert report["unscaled"]["abs_rel"] == pytest.approx(0.1)


def test_predictions_are_measured_as_they_come(drive, model):
    recording = deepfusion.Dataset(drive)
    camera = recording[0].intrinsics
    truths = [frame.ground_truth() for frame in recording]
    assert [truth is None for truth in truths] == [False, True, False]
    images = [frame.image for frame in recording]
    scans = [0, 2]
    for kind in ("depth", "disparity"):
        arrays = [getattr(model.predict(images[i], camera, stretch=True), kind) for i in scans]
        expected = deepfusion.evaluate(arrays, [truths[i] for i in scans], kind=kind)
        seen = model.predict_many(images, camera, stretch=True)
        assert deepfusion.evaluate(seen, (truth for truth in truths), kind=kind) == expected
    with pytest.raises(ValueError, match="only 2"):
        deepfusion.evaluate(model.predict_many(images[:2], camera, stretch=True), truths)
    with pytest.raises(deepfusion.DeepFusionError, match="no image has") as refused:
        deepfusion.evaluate(images[:1], [None])
    assert "have ground truth of the kind" in refused.value.hint


def test_errors_say_what_to_do(drive, model, tmp_path):
    assert deepfusion.DeepFusionError("somebody's own").hint is None
    with pytest.raises(deepfusion.DeepFusionError) as caught:
        deepfusion.load("no-such-network")
    assert "no-such-network" in str(caught.value) and "street" in caught.value.hint
    with pytest.raises(deepfusion.DeepFusionError, match="nowhere"):
        deepfusion.Dataset(tmp_path / "nowhere")
    image = deepfusion.Dataset(drive)[0].image
    with pytest.raises(deepfusion.DeepFusionError, match="no camera"):
        model.predict(image, (0.0, 500.0, 1.0, 1.0))
    with pytest.raises(deepfusion.DeepFusionError, match="camera"):
        model.predict(image).cloud()
    for wrong in [image[:, :, 0], image.astype(np.float32), image[:, :, :2], 7]:
        with pytest.raises((TypeError, ValueError)):
            model.predict(wrong)
    with pytest.raises(ValueError, match="crop"):
        deepfusion.evaluate([np.ones((4, 4))], [np.ones((4, 4))], crop="eigen")
    with pytest.raises(ValueError, match="predictions: expected 0"):
        deepfusion.evaluate([np.ones((4, 4))], [])
    (tmp_path / "broken.png").write_bytes(b"no picture")
    with pytest.raises(deepfusion.DeepFusionError, match="broken.png"):
        model.predict(tmp_path / "broken.png")


@pytest.mark.parametrize(("precision", "most"), [("bf16", 0.005), ("int8", 0.015)])
def test_lower_precision(drive, precision, most):
    """Nearly the same depth on a processor that has it; on another an error that says which do."""
    frame = deepfusion.Dataset(drive)[0]
    try:
        lower = deepfusion.load("street", precision=precision)
    except deepfusion.DeepFusionError as error:
        assert f"{precision} needs a processor with" in str(error)
        return
    found = lower.predict(frame.image, frame.intrinsics).depth
    expected = deepfusion.load("street").predict(frame.image, frame.intrinsics).depth
    apart = np.abs(np.log(found / expected)).mean()
    assert 0 < apart < most
    with pytest.raises(ValueError, match="int4"):
        deepfusion.load("street", precision="int4")


def test_threads(drive, model):
    """One estimator per thread gives the same results; the interpreter is free while they work."""
    frames = list(deepfusion.Dataset(drive))
    expected = [model.predict(f.image, f.intrinsics).depth for f in frames]
    found = [None] * len(frames)

    def work(i, estimator):
        found[i] = estimator.predict(frames[i].image, frames[i].intrinsics).depth

    for estimators in [[model] * 3, [model.another() for _ in frames]]:
        threads = [threading.Thread(target=work, args=(i, e)) for i, e in enumerate(estimators)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert all(np.array_equal(a, b) for a, b in zip(expected, found))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
def test_the_child_of_a_fork_computes(drive):
    """As multiprocessing on Linux before Python 3.14 and DataLoader start processes: the child has none of its parent's threads."""
    code = """
        import os, sys, warnings
        import deepfusion, numpy as np
        warnings.simplefilter("ignore")
        frame = deepfusion.Dataset(sys.argv[1])[0]
        model = deepfusion.load("tiny")
        expected = model.predict(frame.image, frame.intrinsics).depth.tobytes()
        truth = frame.ground_truth()
        child = os.fork()
        if child == 0:
            same = deepfusion.Dataset(sys.argv[1])[0]
            seen = model.predict(same.image, same.intrinsics)
            assert seen.depth.tobytes() == expected
            [again] = model.predict_many([same.image], same.intrinsics)
            assert again.depth.tobytes() == expected
            assert deepfusion.load("tiny").predict(same.image, same.intrinsics).depth.tobytes() == expected
            deepfusion.perceive(seen.depth, same.intrinsics)
            assert np.array_equal(same.ground_truth(), truth)
            assert deepfusion.evaluate([seen], [truth])["n"] == 1
            deepfusion.doctor(sys.argv[1])
            print("the same", flush=True)
            os._exit(0)
        sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    """
    words = [sys.executable, "-c", textwrap.dedent(code), str(drive)]
    # A child that hangs is ended with its parent.
    running = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, start_new_session=True)
    try:
        printed, _ = running.communicate(timeout=60)
    except subprocess.TimeoutExpired:
        os.killpg(running.pid, signal.SIGKILL)
        running.communicate()
        raise
    assert (running.returncode, printed) == (0, "the same\n")


def test_doctor(drive, tmp_path):
    report = deepfusion.doctor(drive)
    assert report["drives"][0]["frames"] == 3
    printed = subprocess.run([sys.executable, "-m", "deepfusion", "doctor", str(drive), "--json"], capture_output=True, check=False)
    assert report == json.loads(printed.stdout), "as the command prints it"
    assert deepfusion.doctor(tmp_path)["recording"]


def test_the_command_gives_the_same_bytes(drive, model, tmp_path):
    command = os.environ.get("DEEPFUSION") or str(Path(sysconfig.get_path("scripts")) / "deepfusion")
    frame = deepfusion.Dataset(drive)[0]
    out = tmp_path / "depth"
    arguments = ["predict", drive, "--model", "tiny", "--save", "npy", "--out", out, "--quiet"]
    subprocess.run([command, *arguments], check=True)
    file = sorted(Path(out).glob("*_depth.npy"))[0]
    assert np.array_equal(np.load(file), model.predict(frame.image, frame.intrinsics).depth)
    with pytest.raises(ValueError, match="multi-scale-flip"):
        model.predict(frame.image, post_process="mirrored")
    looks = {"post_process": "multi-scale-flip"}
    several = tmp_path / "several"
    arguments[arguments.index(out)] = several
    subprocess.run([command, *arguments, "--post-process", looks["post_process"]], check=True)
    theirs = np.load(several / file.name)
    assert np.array_equal(theirs, model.predict(frame.image, frame.intrinsics, **looks).depth)
    assert np.array_equal(theirs, next(model.predict_many([frame.image], frame.intrinsics, **looks)).depth)
    assert not np.array_equal(theirs, np.load(file))
    gt = tmp_path / "gt.npz"
    subprocess.run([command, "data", "export-gt", drive, "--out", gt, "--quiet"], check=True)


@pytest.mark.parametrize("crop", ["none", "garg"])
def test_the_command_gives_the_same_metrics(drive, model, crop):
    command = os.environ.get("DEEPFUSION") or str(Path(sysconfig.get_path("scripts")) / "deepfusion")
    evaluated = subprocess.run(
        [command, "eval", "--model", "tiny", "--data", drive, "--crop", crop, "--json", "--quiet"],
        check=True,
        capture_output=True,
    )
    theirs = json.loads(evaluated.stdout)
    scans = [f for f in deepfusion.Dataset(drive) if f.ground_truth() is not None]
    ours = deepfusion.evaluate(
        [model.predict(f.image, f.intrinsics, stretch=True).disparity for f in scans],
        [f.ground_truth() for f in scans],
        kind="disparity",
        crop=crop,
    )
    # The command computes sharpness from the simulator's dense depth; here only the scans are given.
    both = (ours.keys() & theirs.keys()) - {"sharpness"}
    assert {"n", "protocol", "unscaled", "median_scaled", "scale", "ranges", "hole_rate", "truth_sha256"} <= both
    assert {field: ours[field] for field in both} == {field: theirs[field] for field in both}
    assert ours["protocol"]["crop"] == crop


def test_help_says_what_the_stubs_say():
    """`help(deepfusion.Model)` has the same sentences as an editor."""
    stubs = ast.parse((Path(deepfusion.__file__).parent / "_native.pyi").read_text())
    compared = 0
    for group in (node for node in stubs.body if isinstance(node, ast.ClassDef)):
        for method in (node for node in group.body if isinstance(node, ast.FunctionDef)):
            docstring = ast.get_docstring(method)
            # Constructors have no docstring of their own.
            if docstring and method.name != "__new__":
                there = getattr(getattr(deepfusion, group.name), method.name).__doc__
                assert there and inspect.cleandoc(there) == docstring, f"{group.name}.{method.name}"
                compared += 1
    assert compared > 20
