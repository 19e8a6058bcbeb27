"""The peers of the engines: an exported model in ONNX Runtime and in OpenVINO, on the processor.

pip install onnxruntime openvino numpy
python benches/peers/onnx_inference.py MODEL.onnx [--threads 2] [--runs 30]

Prints for each engine the median and the least time of a run in ms and the peak memory (VmHWM, Linux) of a fresh process
that ran this engine alone. The peak counts loading, while which the file and the weights made from it are both in memory.
OpenVINO runs twice, with f32 and with bf16; the deviation of each engine's depth from ONNX Runtime's, max |a - b| / max |b|,
is printed beside.
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


def onnxruntime_session(model, threads):
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    shape = session.get_inputs()[0].shape
    return shape, lambda image: session.run(["depth"], {"image": image})[0], onnxruntime.__version__


def openvino_session(model, threads, precision):
    import openvino

    core = openvino.Core()
    settings = {
        "INFERENCE_PRECISION_HINT": precision,
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
    parser.add_argument("--engine", choices=ENGINES, help=argparse.SUPPRESS)
    parser.add_argument("--depth", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.engine:
        print(json.dumps(measure(args.engine, args.model, args.threads, args.runs, args.depth)))
        return
    reference = None
    for engine in ENGINES:
        with tempfile.TemporaryDirectory() as folder:
            depth_file = Path(folder) / "depth.npy"
            command = [sys.executable, __file__, *sys.argv[1:], "--engine", engine, "--depth", str(depth_file)]
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
