"""The peers of the engines: an exported model in ONNX Runtime and in OpenVINO, on the processor.

pip install onnxruntime openvino numpy
python benches/peers/onnx_inference.py MODEL.onnx [--threads 2] [--runs 30]

Prints for each engine the median and the least time of a run in ms and the peak memory (VmHWM, Linux) of a fresh process
that ran this engine alone. The peak counts loading, while which the file and the weights made from it are both in memory.
OpenVINO runs twice, with f32 and with bf16; the deviation of each engine's depth from ONNX Runtime's, max |a - b| / max |b|,
is printed beside.

    pip install nncf pillow
    python benches/peers/onnx_inference.py MODEL.onnx --int8 IMAGES [--predict OUT]

quantises the model with NNCF on 32 of a folder's images first and runs OpenVINO a third time, with int8. `--predict` writes the depth of
all of them as OUT/f32/NAME.npy and OUT/int8/NAME.npy, for `deepfusion eval --pred`.
"""
import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ENGINES = ("onnxruntime", "openvino-f32", "openvino-bf16")
CALIBRATED_ON = 32


def onnxruntime_session(model, threads):
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    shape = session.get_inputs()[0].shape
    return shape, lambda image: session.run(["depth"], {"image": image})[0], onnxruntime.__version__


def read(path, shape):
    """An image at the model's size, with its batch."""
    from PIL import Image

    image = Image.open(path).convert("RGB").resize((shape[2], shape[1]), Image.Resampling.BILINEAR)
    return np.asarray(image)[None]


def images_of(folder):
    return sorted(p for p in Path(folder).iterdir() if p.suffix.lower() in (".png", ".jpg", ".jpeg"))


def quantised(model, folder, out):
    """The model in int8, calibrated on images of a folder, as OpenVINO's file."""
    import nncf
    import openvino

    read_model = openvino.Core().read_model(model)
    shape = list(read_model.input("image").shape)
    images = images_of(folder)
    chosen = [images[i * len(images) // CALIBRATED_ON] for i in range(min(CALIBRATED_ON, len(images)))]
    data = nncf.Dataset(chosen, lambda path: {"image": read(path, shape)})
    done = nncf.quantize(read_model, data, subset_size=len(chosen), target_device=nncf.TargetDevice.CPU)
    openvino.save_model(done, out, compress_to_fp16=False)
    return str(out)


def predict(model, threads, precision, folder, out):
    """The depth of every image of a folder."""
    shape, run, _ = openvino_session(model, threads, precision)
    out.mkdir(parents=True, exist_ok=True)
    for path in images_of(folder):
        np.save(out / f"{path.stem}.npy", np.squeeze(run(read(path, shape))).astype(np.float32))


def openvino_session(model, threads, precision):
    import openvino

    core = openvino.Core()
    settings = {
        # What is not quantised of a quantised model runs in bf16.
        "INFERENCE_PRECISION_HINT": "bf16" if precision == "int8" else precision,
        "INFERENCE_NUM_THREADS": threads,
        "NUM_STREAMS": 1,
        "PERFORMANCE_HINT": "LATENCY",
    }
    compiled = core.compile_model(model, "CPU", settings)
    request = compiled.create_infer_request()

    def run(image):
        request.infer({"image": image})
        return request.get_tensor("depth").data

    return list(compiled.input("image").shape), run, openvino.__version__.split("-")[0]


def peak_mb():
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))


def measure(engine, model, threads, runs, depth_file):
    """One engine in this process."""
    name, _, precision = engine.partition("-")
    if name == "onnxruntime":
        shape, run, version = onnxruntime_session(model, threads)
    else:
        shape, run, version = openvino_session(model, threads, precision)
    image = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    for _ in range(3):
        run(image)
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        run(image)
        times.append(1e3 * (time.perf_counter() - start))
    peak = peak_mb()
    np.save(depth_file, run(image))
    return {
        "version": version,
        "size": f"{shape[2]}x{shape[1]}",
        "median_ms": statistics.median(times),
        "least_ms": min(times),
        "peak_mb": peak,
    }


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("model")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--int8", metavar="IMAGES", help="quantise the model on a folder's images, and run that too")
    parser.add_argument("--predict", metavar="OUT", type=Path, help="write the depth of these images, in f32 and int8")
    parser.add_argument("--engine", choices=(*ENGINES, "openvino-int8"), help=argparse.SUPPRESS)
    parser.add_argument("--depth", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.engine:
        print(json.dumps(measure(args.engine, args.model, args.threads, args.runs, args.depth)))
        return
    engines = [(engine, args.model) for engine in ENGINES]
    kept = tempfile.TemporaryDirectory()
    if args.int8:
        model = quantised(args.model, args.int8, Path(kept.name) / "int8.xml")
        engines.append(("openvino-int8", model))
        if args.predict:
            predict(args.model, args.threads, "f32", args.int8, args.predict / "f32")
            predict(model, args.threads, "int8", args.int8, args.predict / "int8")
    reference = None
    for engine, model in engines:
        with tempfile.TemporaryDirectory() as folder:
            depth_file = Path(folder) / "depth.npy"
            command = [sys.executable, __file__, model, "--threads", str(args.threads), "--runs", str(args.runs)]
            command += ["--engine", engine, "--depth", str(depth_file)]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                print(f"{engine}: {done.stderr.strip().splitlines()[-1]}")
                continue
            report = json.loads(done.stdout.splitlines()[-1])
            depth = np.load(depth_file)
        reference = depth if reference is None else reference
        deviation = np.abs(depth - reference).max() / np.abs(reference).max()
        print(
            f"{engine} {report['version']}, {report['size']}, {args.threads} threads: median {report['median_ms']:.1f} ms, "
            f"least {report['least_ms']:.1f} ms, peak {report['peak_mb']:.0f} MB, deviation {deviation:.1e}"
        )


if __name__ == "__main__":
    main()
