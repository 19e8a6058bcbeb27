#!/usr/bin/env python3
"""Whether an exported file means elsewhere what it means here.

    cargo run --release -- export --model RUN --out model.onnx
    python crates/deepfusion-onnx/tests/other_runtimes.py model.onnx

Checks the file with onnx.checker (types and shapes inferred in full), then runs it in onnx's own reference evaluator
(NumPy, node by node, by the specification), in ONNX Runtime and, where installed, in OpenVINO, on a picture of noise and
on one of ramps. The evaluator's result is what the others are compared with: max |a - b| / max |b| may be 1e-4, as in
`export`. depth x disparity must be 1.

Needs onnx, onnxruntime and numpy; openvino is optional. Run by hand: the Rust tests need none of it.
"""

import sys

import numpy as np
import onnx
import onnxruntime
from onnx.reference import ReferenceEvaluator

TOLERANCE = 1e-4


def pictures(height, width):
    """Noise, and ramps of another direction in each colour."""
    yield "noise", np.random.default_rng(1).integers(0, 256, (1, height, width, 3), dtype=np.uint8)
    down, across = np.mgrid[0:height, 0:width]
    ramps = [across * 255 // width, down * 255 // height, 255 - down * 127 // height]
    yield "ramps", np.stack(ramps, -1)[None].astype(np.uint8)


def engines(path):
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    names = ["depth", "disparity"]
    yield "ONNX Runtime " + onnxruntime.__version__, lambda x: session.run(names, {"image": x})
    try:
        import openvino
    except ImportError:
        print("skipped: openvino is not installed")
        return
    model = openvino.Core().compile_model(path, "CPU", {"INFERENCE_PRECISION_HINT": "f32"})

    def run(x):
        outputs = model({"image": x})
        return [outputs[name] for name in names]

    yield "OpenVINO " + openvino.__version__.split("-")[0], run


def main(path):
    model = onnx.load(path)
    onnx.checker.check_model(model, full_check=True)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    print(f"{path}: opset {model.opset_import[0].version}, {len(model.graph.node)} nodes, {metadata}")
    dims = model.graph.input[0].type.tensor_type.shape.dim
    _, height, width, _ = (d.dim_value for d in dims)
    evaluator = ReferenceEvaluator(model)
    nearest, farthest = float(metadata["depth_min_m"]), float(metadata["depth_max_m"])
    failed = False
    others = list(engines(path))
    for picture, image in pictures(height, width):
        expected = evaluator.run(["depth", "disparity"], {"image": image})
        for name, run in others:
            found = run(image)
            for output, a, b in zip(("depth", "disparity"), found, expected):
                assert a.shape == (1, 1, height, width), a.shape
                deviation = np.abs(a - b).max() / np.abs(b).max()
                failed |= not deviation <= TOLERANCE
                print(f"{name}, {picture}, {output}: {deviation:.1e}")
            depth, disparity = found
            failed |= not np.abs(depth * disparity - 1).max() < 1e-5
            failed |= not (depth.min() > nearest * 0.999 and depth.max() < farthest * 1.001)
    if failed:
        sys.exit("the engines do not agree")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
