#!/usr/bin/env python3
"""Reference values for tests/reference.rs: the evaluation protocol written with NumPy alone, on random arrays.

    python3 make_reference.py            # needs numpy; with opencv-python it also checks the resize against cv2

Writes, beside itself: gt.npz, depth.npz, disparity.npz (arrays of different sizes, float32 and float64, some in Fortran
order), stack_gt.npy, stack_pred.npy (N×H×W), and expected.json.
"""
import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
RANGES = [(0, 10), (10, 20), (20, 40), (40, 80)]


def resize(image, height, width):
    """Bilinear with half-pixel centres and a repeated border: OpenCV's INTER_LINEAR, in float64."""
    def taps(source, destination):
        at = (np.arange(destination) + 0.5) * source / destination - 0.5
        at = np.clip(at, 0, source - 1)
        first = np.floor(at).astype(int)
        return first, np.minimum(first + 1, source - 1), at - first
    x0, x1, wx = taps(image.shape[1], width)
    y0, y1, wy = taps(image.shape[0], height)
    image = image.astype(np.float64)
    rows = image[:, x0] * (1 - wx) + image[:, x1] * wx
    return rows[y0] * (1 - wy)[:, None] + rows[y1] * wy[:, None]


def seven(gt, pred):
    ratio = np.maximum(gt / pred, pred / gt)
    return [np.mean(np.abs(gt - pred) / gt), np.mean((gt - pred) ** 2 / gt), np.sqrt(np.mean((gt - pred) ** 2)),
            np.sqrt(np.mean((np.log(gt) - np.log(pred)) ** 2)),
            np.mean(ratio < 1.25), np.mean(ratio < 1.25 ** 2), np.mean(ratio < 1.25 ** 3)]


def evaluate(pairs, kind, crop, cap, low, factor=None):
    rows, scaled, fixed, ratios, pooled = [], [], [], [], []
    for pred, gt in pairs:
        gt = gt.astype(np.float64)
        height, width = gt.shape
        disparity = 1 / pred.astype(np.float64) if kind == "depth" else pred
        depth = 1 / resize(disparity, height, width)
        mask = (gt > low) & (gt < cap)
        if crop == "garg":
            edges = np.array([0.40810811 * height, 0.99189189 * height, 0.03594771 * width, 0.96405229 * width]).astype(int)
            window = np.zeros_like(mask)
            window[edges[0]:edges[1], edges[2]:edges[3]] = True
            mask &= window
        g, p = gt[mask], depth[mask]
        if len(g) == 0:
            continue
        ratio = np.median(g) / np.median(p)
        ratios.append(ratio)
        clamp = lambda d: np.clip(d, low, cap)
        rows.append(seven(g, clamp(p)))
        scaled.append(seven(g, clamp(p * ratio)))
        fixed.append(seven(g, clamp(p * (factor or 1))))
        pooled.append((g, clamp(p)))
    g, p = (np.concatenate(part) for part in zip(*pooled))
    ranges = []
    for low_m, high_m in RANGES:
        inside = (g >= low_m) & (g < high_m)
        values = seven(g[inside], p[inside]) if inside.any() else None
        ranges.append({"n": int(inside.sum()), "abs_rel": values and values[0], "rmse": values and values[2]})
    ratios = np.array(ratios)
    return {
        "n": len(rows), "unscaled": list(np.mean(rows, 0)), "median_scaled": list(np.mean(scaled, 0)),
        "fixed_scaled": list(np.mean(fixed, 0)), "ranges": ranges,
        "scale": {"median": np.median(ratios), "std_rel": np.std(ratios) / np.median(ratios), "bias": np.mean(-np.log(ratios))},
    }


def trivial(scans):
    """Per-pixel mean of the scans, holes take their row's mean, empty rows 80 m."""
    stack = np.stack(scans).astype(np.float64)
    n = (stack > 0).sum(0)
    mean = np.where(n > 0, stack.sum(0) / np.maximum(n, 1), 0)
    rows = np.array([row[row > 0].mean() if (row > 0).any() else 80.0 for row in mean])
    return np.where(mean > 0, mean, rows[:, None])


def main():
    random = np.random.default_rng(20)
    # (ground truth h, w), (prediction h, w): larger, smaller, equal, and another aspect ratio.
    sizes = [((37, 122), (19, 64)), ((38, 124), (38, 124)), ((30, 40), (48, 71)), ((37, 122), (24, 24))]
    gt, depth = {}, {}
    for index, ((h, w), (ph, pw)) in enumerate(sizes):
        truth = random.uniform(0.5, 100, (h, w)) * (random.random((h, w)) < 0.3)
        prediction = random.uniform(1, 95, (ph, pw))
        kind = np.float64 if index % 2 else np.float32
        gt[f"{index:010d}"] = truth.astype(kind)
        depth[f"{index:010d}"] = np.asfortranarray(prediction.astype(np.float32 if index % 2 else np.float64))
    # An image without any ground truth is skipped.
    gt["drive/empty"] = np.zeros((20, 20), np.float32)
    depth["drive/empty"] = np.ones((20, 20), np.float32)
    disparity = {name: (1 / array).astype(array.dtype) for name, array in depth.items()}
    np.savez_compressed(HERE / "gt.npz", **gt)
    # Another order than the ground truth's: matched by name.
    np.savez(HERE / "depth.npz", **dict(reversed(depth.items())))
    np.savez_compressed(HERE / "disparity.npz", **disparity)
    stack_gt = np.stack([random.uniform(0.5, 100, (21, 30)) * (random.random((21, 30)) < 0.5) for _ in range(3)]).astype(np.float32)
    stack_pred = random.uniform(1, 95, (3, 10, 15))
    np.save(HERE / "stack_gt.npy", stack_gt)
    np.save(HERE / "stack_pred.npy", stack_pred)

    cases = []
    for kind, arrays in [("depth", depth), ("disparity", disparity)]:
        for crop in ["none", "garg"]:
            for cap, low, factor in [(80.0, 1e-3, None), (50.0, 2.0, 1.7)]:
                pairs = [(arrays[name], gt[name]) for name in gt]
                cases.append({"files": [f"{kind}.npz", "gt.npz"], "kind": kind, "crop": crop, "cap": cap, "min": low,
                              "factor": factor, "expected": evaluate(pairs, kind, crop, cap, low, factor)})
    cases.append({"files": ["stack_pred.npy", "stack_gt.npy"], "kind": "depth", "crop": "none", "cap": 80.0, "min": 1e-3,
                  "factor": None, "expected": evaluate(zip(stack_pred, stack_gt), "depth", "none", 80.0, 1e-3)})
    rows = {"trivial_all": trivial(list(stack_gt)), "trivial_without_1": trivial([stack_gt[0], stack_gt[2]])}
    expected = {"cases": cases, **{name: [round(float(v), 9) for v in row.ravel()] for name, row in rows.items()}}
    (HERE / "expected.json").write_text(json.dumps(expected, indent=None, separators=(",", ":")))

    try:
        import cv2
    except ImportError:
        print("no cv2: the resize was not checked against it")
        return
    worst = 0.0
    for (h, w), (ph, pw) in sizes:
        image = random.random((ph, pw)).astype(np.float32)
        worst = max(worst, np.abs(cv2.resize(image, (w, h), interpolation=cv2.INTER_LINEAR) - resize(image, h, w)).max())
    print(f"largest difference of the resize from cv2 {cv2.__version__}, values in [0, 1): {worst:.2e}")


main()
