#!/usr/bin/env python3
"""Reference values for tests/sharpness.rs: depth boundary errors by scikit-image's Canny and SciPy's distance transform.

    python3 sharpness.py         # needs numpy, scipy, scikit-image and opencv-python; run by hand in this folder

Writes sharpness.npz (truths and predictions by name: float32, metres; truth 0 = unknown, infinite = sky; predicted NaN =
none) and sharpness.json. Surfaces are rough by 1 %, so that no two gradients are equal: which of two equal pixels is the
edge is a matter of taste, on which the libraries differ. Printed as well: what OpenCV's Canny, on maps cut into 256 steps,
makes of the same boundaries.
"""
import json
from pathlib import Path

import cv2
import numpy as np
import scipy
import skimage
from scipy.ndimage import distance_transform_edt, gaussian_filter, shift
from skimage.feature import canny

HERE = Path(__file__).parent
LOW, CAP = 1e-3, 80.0
HEIGHT, WIDTH = 60, 104


def street(random):
    """A road, a wall that recedes, three boxes and the sky above."""
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float64)
    depth = np.full((HEIGHT, WIDTH), np.inf)
    below = rows > 22
    depth[below] = 60 * 1.5 / (rows[below] - 22)
    wall = (columns < 30) & (rows > 6) & (rows < 44)
    depth[wall] = np.minimum(depth[wall], 60 * 6 / (52 - columns[wall]))
    for x, y, w, h, d in [(40, 14, 18, 20, 14.0), (62, 20, 9, 9, 31.0), (80, 4, 12, 46, 6.0)]:
        depth[y:y + h, x:x + w] = np.minimum(depth[y:y + h, x:x + w], d)
    return depth * np.exp(0.01 * gaussian_filter(random.standard_normal(depth.shape), 0.7))


def pair(truth, depth, crop):
    """Known pixels of the crop, both clamped, the prediction median-scaled."""
    if crop == "garg":
        edges = np.array([0.40810811 * HEIGHT, 0.99189189 * HEIGHT, 0.03594771 * WIDTH, 0.96405229 * WIDTH]).astype(int)
        truth, depth = (a[edges[0]:edges[1], edges[2]:edges[3]] for a in (truth, depth))
    usable = np.isfinite(depth) & (depth > 0)
    known = (truth > LOW) & usable
    within = known & (truth < CAP)
    ratio = np.median(truth[within]) / np.median(depth[within])
    clamp = lambda d: np.clip(np.where(known, d, CAP), LOW, CAP)
    return clamp(truth), clamp(depth * ratio), known


def normalised(depth, known):
    least, most = depth[known].min(), depth[known].max()
    return np.where(known, (depth - least) / (most - least), 0)


def boundary(truth, depth, known):
    find = lambda d: canny(normalised(d, known), sigma=np.sqrt(2), low_threshold=0.15, high_threshold=0.3, mask=known)
    true, seen = find(truth), find(depth)
    far = np.full(true.shape, np.inf)
    to_true = distance_transform_edt(~true)
    to_seen = distance_transform_edt(~seen) if seen.any() else far
    near = seen & (to_true < 10)
    return {
        "accuracy_px": to_true[near].mean() if near.any() else 10.0,
        "completeness_px": np.minimum(to_seen, 10)[true].mean(),
        "true_edges": int(true.sum()), "seen_edges": int(seen.sum()),
    }


def flying(truth, depth, known):
    near = hits = 0
    for y, x in np.argwhere(known):
        window = np.s_[max(y - 2, 0):y + 3, max(x - 2, 0):x + 3]
        values, valid = truth[window], known[window]
        jump = lambda a, b, both: ((np.maximum(a, b) > 1.25 * np.minimum(a, b)) & both).any()
        if not (jump(values[1:], values[:-1], valid[1:] & valid[:-1])
                or jump(values[:, 1:], values[:, :-1], valid[:, 1:] & valid[:, :-1])):
            continue
        near += 1
        d, around = depth[y, x], values[valid]
        hits += around.min() < d < around.max() and (np.abs(d - around) > 0.1 * around).all()
    return hits / near


def by_opencv(truth, depth, known):
    """The same boundaries from OpenCV's Canny (8 bits, its own suppression), where everything is known."""
    def find(d):
        image = cv2.GaussianBlur(np.round(255 * normalised(d, known)).astype(np.uint8), (13, 13), np.sqrt(2))
        return cv2.Canny(image, 0.15 * 255, 0.3 * 255, apertureSize=3, L2gradient=True) > 0
    true, seen = find(truth), find(depth)
    to_true, to_seen = (cv2.distanceTransform((~e).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) for e in (true, seen))
    near = seen & (to_true < 10)
    return to_true[near].mean() if near.any() else 10.0, np.minimum(to_seen, 10)[true].mean()


def main():
    random = np.random.default_rng(5)
    truth = street(random)
    finite = np.minimum(truth, 100)
    rough = lambda: np.exp(0.01 * gaussian_filter(random.standard_normal(truth.shape), 0.7))
    unknown = truth.copy()
    unknown[10:30, 50:70] = 0
    unknown[random.random(truth.shape) < 0.002] = np.nan
    holes = finite * rough()
    holes[40:48, 20:60] = np.nan
    coarse = cv2.resize(1 / finite, (26, 15), interpolation=cv2.INTER_AREA)
    truths = {"street": truth, "partly": unknown}
    cases = {
        "exact": ("street", finite),
        "moved": ("street", 1.3 * shift(finite, (0, 3), order=0, mode="nearest") * rough()),
        "smooth": ("street", 1 / gaussian_filter(1 / finite, 2.5) * rough()),
        "coarse": ("street", 1 / cv2.resize(coarse, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR) * rough()),
        "flat": ("street", 1 / gaussian_filter(1 / finite, 14)),
        "unknown": ("partly", shift(finite, (1, -2), order=0, mode="nearest") * rough()),
        "holes": ("street", holes),
    }
    short = lambda a: (a.astype(np.float32).view(np.uint32) & 0xFFFFF000).view(np.float32)  # 11 bits: a smaller file
    truths = {name: short(gt) for name, gt in truths.items()}
    arrays, rows = dict(truths), []
    for name, (gt, depth) in cases.items():
        arrays[name] = short(depth)
        for crop in ["none", "garg"]:
            maps = pair(truths[gt].astype(np.float64), arrays[name].astype(np.float64), crop)
            expected = {**boundary(*maps), "flying_share": flying(*maps)}
            rows.append({"truth": gt, "prediction": name, "crop": crop, **expected})
            print(name, crop, expected, "OpenCV:", by_opencv(*maps) if maps[2].all() else "-")
    np.savez_compressed(HERE / "sharpness.npz", **arrays)
    (HERE / "sharpness.json").write_text(json.dumps(rows, separators=(",", ":")))
    print("scikit-image", skimage.__version__, "scipy", scipy.__version__, "OpenCV", cv2.__version__)


main()
