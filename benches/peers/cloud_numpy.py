"""The peer of `cargo bench -p deepfusion-geometry`: the same disparities to the same coloured cloud in NumPy.

pip install numpy
python benches/peers/cloud_numpy.py

Disparity -> depth, mask of valid depths up to 80 m, back-projection with K, a colour a point; all float32, rays computed
beforehand, the mask applied before anything is multiplied. The median of 300 runs and, for machines that are
shared, the fastest.
"""
import statistics
import time

import numpy as np

WIDTH, HEIGHT, MAX_DEPTH_M = 640, 192, 80.0
FX, FY, CX, CY = 0.58 * WIDTH, 1.92 * HEIGHT, 319.5, 95.5


def cloud(disparity, rgb, rays):
    with np.errstate(divide="ignore"):
        depth = np.float32(1) / disparity
    valid = (depth > 0) & (depth <= MAX_DEPTH_M) & np.isfinite(depth)
    return rays[valid] * depth[valid][:, None], rgb[valid]


def main():
    x, y = np.meshgrid(np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32))
    ground = np.maximum((y - 80) / np.float32(1.65 * 369), 0)
    disparity = (ground + 0.011 + 0.004 * np.sin(x * 0.37) * np.cos(y * 0.53)).astype(np.float32)
    rgb = (np.arange(WIDTH * HEIGHT * 3) * 7 % 256).astype(np.uint8).reshape(HEIGHT, WIDTH, 3)
    rays = np.stack([(x - CX) / FX, (y - CY) / FY, np.ones_like(x)], axis=-1).astype(np.float32)
    print(len(cloud(disparity, rgb, rays)[0]), "points, NumPy", np.__version__)
    times = []
    for _ in range(310):
        start = time.perf_counter()
        cloud(disparity, rgb, rays)
        times.append(time.perf_counter() - start)
    median, fastest = statistics.median(times[10:]) * 1e3, min(times) * 1e3
    print(f"disparity to coloured cloud: {median:.3f} ms (fastest {fastest:.3f})")


if __name__ == "__main__":
    main()
