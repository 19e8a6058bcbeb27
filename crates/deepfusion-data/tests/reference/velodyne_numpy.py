"""Sparse ground truth of small synthetic scans, the reference for `ground_truth`. Run in this folder:
python velodyne_numpy.py

Writes velodyne_<case>.bin (the scan), velodyne_<case>_cam.txt and _velo.txt (its calibration files) and
velodyne_<case>.npz with the arrays z and velodyne (NumPy 2.4.6). The two conventions are stated in
`GtKind`; here they are computed on whole arrays, by sorting instead of comparing.

- exact: a camera without rotation and powers of two throughout, so that every product is exact in f64:
  pixels that lie on a half, where rounding to even shows, and points that share a pixel.
- real: KITTI's rotations and offsets, random points, also behind the sensor, behind the camera, out of view.
"""
import numpy as np

AXES = "0 -1 0 0 0 -1 1 0 0"
CASES = {
    "exact": dict(size=(64, 32), p="64 0 32 0 0 64 16 0 0 0 1 0", rect="1 0 0 0 1 0 0 0 1", r=AXES, t="0 0 0"),
    "real": dict(
        size=(124, 38),
        p="7.215377e+01 0 6.095593e+01 4.485728e+00 0 7.215377e+01 1.728540e+01 2.163791e-02 0 0 1 2.745884e-03",
        rect="9.999239e-01 9.837760e-03 -7.445048e-03 -9.869795e-03 9.999421e-01 -4.278459e-03 7.402527e-03 "
        "4.351614e-03 9.999631e-01",
        r="7.533745e-03 -9.999714e-01 -6.166020e-04 1.480249e-02 7.280733e-04 -9.998902e-01 9.998621e-01 "
        "7.523790e-03 1.480755e-02",
        t="-4.069766e-03 -7.631618e-02 -2.717806e-01",
    ),
}


def numbers(text, *shape):
    return np.array(text.split(), float).reshape(shape)


def points_of(case, rng):
    if case == "exact":
        # x forward is 2, 4 or 8: u = 32 - 64 y / x on a grid of half pixels, several points to a pixel.
        x = rng.choice([2.0, 4.0, 8.0], 900)
        y = x * rng.integers(-70, 70, 900) / 128
        z = x * rng.integers(-36, 36, 900) / 128
    else:
        x = np.concatenate([rng.uniform(-5, 40, 1400), rng.uniform(0, 0.4, 100)])
        y, z = x * rng.uniform(-1, 1, 1500) + rng.normal(0, 0.1, 1500), rng.uniform(-2, 1, 1500)
    return np.stack([x, y, z, rng.uniform(0, 1, len(x))], 1).astype(np.float32)


def depth(points, projection, size, kind):
    width, height = size
    ahead = points[points[:, 0] >= 0].astype(np.float64)
    q = np.hstack([ahead[:, :3], np.ones((len(ahead), 1))]) @ projection.T
    with np.errstate(all="ignore"):
        pixel = np.round(q[:, :2] / q[:, 2:])  # NumPy rounds halves to even
    value = q[:, 2]
    if kind == "velodyne":
        pixel, value = pixel - 1, ahead[:, 0]
    inside = (pixel >= 0).all(1) & (pixel < [width, height]).all(1) & (value > 0)
    (u, v), value = pixel[inside].astype(int).T, value[inside]
    result = np.full((height, width), np.inf)
    np.minimum.at(result, (v, u), value)
    result[np.isinf(result)] = 0
    return result.astype(np.float32)


for case, c in CASES.items():
    points = points_of(case, np.random.default_rng(11))
    points.tofile(f"velodyne_{case}.bin")
    with open(f"velodyne_{case}_cam.txt", "w") as f:
        f.write(f"S_rect_02: {c['size'][0]} {c['size'][1]}\nR_rect_00: {c['rect']}\nP_rect_02: {c['p']}\n")
    with open(f"velodyne_{case}_velo.txt", "w") as f:
        f.write(f"R: {c['r']}\nT: {c['t']}\n")
    rigid, rect = np.eye(4), np.eye(4)
    rigid[:3, :3], rigid[:3, 3], rect[:3, :3] = numbers(c["r"], 3, 3), numbers(c["t"], 3), numbers(c["rect"], 3, 3)
    projection = numbers(c["p"], 3, 4) @ rect @ rigid
    maps = {kind: depth(points, projection, c["size"], kind) for kind in ("z", "velodyne")}
    np.savez_compressed(f"velodyne_{case}.npz", **maps)
    print(case, {kind: int((m > 0).sum()) for kind, m in maps.items()})
