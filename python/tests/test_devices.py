"""The devices of networks, as far as they can be tested without a GPU."""

import deepfusion
import numpy as np
import pytest
from deepfusion import _native
from deepfusion._devices import own_gpu

QUICK = {"preset": "tiny", "steps": 2, "batch": 1, "size": {"width": 64, "height": 64}, "seed": 4, "validation_share": 0.2}
LACKING = [name for name in ("metal", "cuda", "wgpu", "vulkan") if name not in deepfusion.devices()]


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    return deepfusion.simulate(tmp_path_factory.mktemp("devices"), frames=12, seed=3, size=(192, 64), scan_every=0)


def test_the_processor_is_the_default(street):
    frame = deepfusion.Dataset(street)[0]
    by_default, by_name = deepfusion.load("tiny"), deepfusion.load("tiny", device="cpu")
    assert (by_name.device, by_name.engine) == (by_default.device, by_default.engine) == ("cpu", "fused")
    assert by_name.another().device == "cpu"
    depths = [model.predict(frame.image, frame.intrinsics).depth for model in (by_default, by_name)]
    assert np.array_equal(*depths)


def test_auto_is_a_device_that_the_package_has():
    assert deepfusion.devices()[0] == "cpu"
    assert _native.fastest().partition(":")[0] in deepfusion.devices()
    assert deepfusion.load("tiny", device="auto").device.partition(":")[0] in deepfusion.devices()


def test_training_on_the_processor_by_name_is_the_same(street, tmp_path):
    runs = [deepfusion.train(QUICK, street, out=tmp_path / f"{i}", init="none", **named) for i, named in enumerate([{}, {"device": "cpu"}])]
    assert runs[0].losses == runs[1].losses


def test_a_backend_that_was_not_built_says_how_to_build_it(street, tmp_path):
    if not LACKING:
        pytest.skip("this package has every backend")
    name, out = LACKING[0], tmp_path / "run"
    for ask in [
        lambda device: deepfusion.load("tiny", device=device),
        lambda device: deepfusion.train(QUICK, street, out=out, device=device),
        lambda device: deepfusion.adapt(street, "tiny", out=out, device=device),
    ]:
        for device in [name, f"{name}:1"]:
            with pytest.raises(deepfusion.DeepFusionError, match=f"no `{name}` backend") as caught:
                ask(device)
            assert f"--features {name}" in caught.value.hint and "pip install" in caught.value.hint
    assert not out.exists()


@pytest.mark.parametrize("word", ["gpu", "CUDA", "", "cuda:x", "cpu:0"])
def test_names_that_are_not_a_device(word):
    with pytest.raises(deepfusion.DeepFusionError, match="device") as caught:
        deepfusion.load("tiny", device=word)
    assert "cpu" in caught.value.hint or "cuda:1" in caught.value.hint


def test_a_gpu_computes_in_f32():
    """Refused before the GPU is searched for."""
    with pytest.raises(deepfusion.DeepFusionError, match="bf16") as caught:
        deepfusion.load("tiny", precision="bf16", device="cuda")
    assert "f32" in caught.value.hint


def test_each_worker_has_a_gpu_of_its_own(monkeypatch):
    """By the number that torchrun and similar launchers give each process of a machine."""

    class Workers:
        rank, count = 3, 4

        def sum(self, values):
            pass

    for name in ("LOCAL_RANK", "OMPI_COMM_WORLD_LOCAL_RANK", "MPI_LOCALRANKID", "SLURM_LOCALID", "CUDA_VISIBLE_DEVICES"):
        monkeypatch.delenv(name, raising=False)
    assert own_gpu("cuda", Workers()) == "cuda"
    monkeypatch.setenv("SLURM_LOCALID", "1")
    assert [own_gpu(device, Workers()) for device in ("cuda", "vulkan", "cuda:0", "cpu")] == ["cuda:1", "vulkan", "cuda:0", "cpu"]
    # "auto" must not choose the first GPU for all of four processes.
    for fastest, own in [("cuda:0", "cuda:1"), ("cpu", "cpu"), ("vulkan:1", "vulkan:1")]:
        monkeypatch.setattr(_native, "fastest", lambda fastest=fastest: fastest)
        assert own_gpu("auto", Workers()) == own
        assert own_gpu("auto", None) == "auto"
    assert own_gpu("cuda", None) == "cuda"
    # Each process sees only its own GPU.
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "5")
    assert own_gpu("cuda", Workers()) == "cuda:0"
