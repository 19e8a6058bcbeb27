#!/usr/bin/env python3
"""Reference values for tests/points.rs: point distances written with NumPy alone, on random depths.

    python3 points.py            # needs numpy; run by hand in this folder

Writes points.json: three images (ground truth with gaps, a prediction of another size, a camera) and what the distances
of all their pixels are. All pixels are drawn, so that no random numbers have to agree.
"""
import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
RANGES = [(0, 10), (10, 20), (20, 40), (40, 80)]
LOW, CAP = 1e-3, 80.0


def resize(image, height, width):
    """Bilinear with half-pixel centres and a repeated border: OpenCV's INTER_LINEAR, in float64."""
    def taps(source, destination):
        at = np.clip((np.arange(destination) + 0.5) * source / destination - 0.5, 0, source - 1)
        first = np.floor(at).astype(int)
        return first, np.minimum(first + 1, source - 1), at - first
    x0, x1, wx = taps(image.shape[1], width)
    y0, y1, wy = taps(image.shape[0], height)
    rows = image[:, x0] * (1 - wx) + image[:, x1] * wx
    return rows[y0] * (1 - wy)[:, None] + rows[y1] * wy[:, None]


def points(depth, K, v, u):
    """P = D K⁻¹ (u, v, 1)ᵀ."""
    rays = np.linalg.inv(K) @ np.stack([u, v, np.ones_like(u)]).astype(np.float64)
    return (depth * rays).T


def errors(distances, images):
    if len(distances) == 0:
        return {"n": 0, "mean_m": None, "std_m": None, "sem_m": None, "sem_images_m": None}
    mean, n = distances.mean(), len(distances)
    std = distances.std(ddof=1) if n > 1 else None
    groups = [(distances[images == g] - mean).sum() for g in np.unique(images)]
    G = len(groups)
    return {
        "n": n, "mean_m": mean, "std_m": std, "sem_m": None if std is None else std / np.sqrt(n),
        "sem_images_m": None if G < 2 else float(np.sqrt(G / (G - 1) * np.sum(np.square(groups))) / n),
    }


def main():
    rng = np.random.default_rng(11)
    height, width = 9, 14
    K = np.array([[12.5, 0, 6.3], [0, 11.0, 4.1], [0, 0, 1]])
    images, true, seen, scaled, number = [], [], [], [], []
    for i in range(3):
        gt = np.exp(rng.uniform(np.log(2), np.log(120), (height, width)))
        gt[rng.random(gt.shape) < 0.4] = 0
        pred = np.exp(rng.uniform(np.log(2), np.log(110), (5, 7))) * (0.7 + 0.2 * i)
        images.append({"ground_truth": gt.ravel().tolist(), "depth": pred.ravel().tolist()})
        mask = (gt > LOW) & (gt < CAP)
        v, u = np.nonzero(mask)
        depth = 1 / resize(1 / pred, height, width)[mask]
        ratio = np.median(gt[mask]) / np.median(depth)
        true.append(points(gt[mask], K, v, u))
        seen.append(points(np.clip(depth, LOW, CAP), K, v, u))
        scaled.append(points(np.clip(depth * ratio, LOW, CAP), K, v, u))
        number.append(np.full(len(u), i))
    true, seen, scaled = map(np.concatenate, (true, seen, scaled))
    number = np.concatenate(number)
    unscaled = np.linalg.norm(seen - true, axis=1)
    median = np.linalg.norm(scaled - true, axis=1)
    ranges = []
    for low, high in RANGES:
        inside = (true[:, 2] >= low) & (true[:, 2] < high)
        ranges.append({"from_m": low, "to_m": high, "unscaled": errors(unscaled[inside], number[inside]),
                       "median_scaled": errors(median[inside], number[inside])})
    out = {
        "size": [width, height], "prediction_size": [7, 5],
        "camera": [K[0, 0], K[1, 1], K[0, 2], K[1, 2]], "images": images,
        "unscaled": errors(unscaled, number), "median_scaled": errors(median, number), "ranges": ranges,
        "first_truth": true[0].tolist(), "first_predicted": seen[0].tolist(),
    }
    (HERE / "points.json").write_text(json.dumps(out, indent=None) + "\n")


if __name__ == "__main__":
    main()
