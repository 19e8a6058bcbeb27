"""A fisheye image's correction by OpenCV and SciPy, for crates/deepfusion-data/tests/lens.rs.

Needs: opencv-python, numpy, scipy, pillow; lens_source.png of lens_opencv.py. Run: python lens_fisheye_opencv.py (writes
lens_fisheye*.png and lens_fisheye_opencv.txt beside it)

The corrected camera sees the largest rectangle of rays that are all in the image, from cv2.fisheye.undistortPoints of every
pixel of the border; "wide" is cut at 60 degrees to each side. The map is cv2.fisheye.initUndistortRectifyMap's. SciPy
interpolates: cv2.remap rounds coordinates to 1/32 pixel.
"""
from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from scipy.ndimage import map_coordinates

HERE = Path(__file__).parent
W, H = 96, 64
LIMIT = np.tan(np.radians(60.0))
image = np.array(Image.open(HERE / "lens_source.png"))
LENSES = {
    "fisheye": ([70.0, 68.0, 49.5, 30.0], [0.05, -0.02, 0.01, -0.003]),
    "fisheye_wide": ([34.0, 34.0, 47.0, 32.5], [0.0034824, 0.000715, -0.00205, 0.0002]),
}
lines = []
for name, (k, d) in LENSES.items():
    K = np.array([[k[0], 0, k[2]], [0, k[1], k[3]], [0, 0, 1]])
    d = np.array(d)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)

    def ideal(pixels):
        pixels = np.array(pixels, dtype=np.float64).reshape(-1, 1, 2)
        rays = cv2.fisheye.undistortPoints(pixels, K, d, criteria=criteria).reshape(-1, 2)
        # A pixel beyond 90 degrees, which no pinhole camera sees, lands on the other side of the axis, where tan is negative.
        before = ((pixels.reshape(-1, 2) - K[:2, 2]) * rays).sum(axis=1) > 0
        return rays[before]

    x0 = max(ideal([(0, v) for v in range(H)])[:, 0].max(), -LIMIT)
    x1 = min(ideal([(W - 1, v) for v in range(H)])[:, 0].min(), LIMIT)
    y0 = max(ideal([(u, 0) for u in range(W)])[:, 1].max(), -LIMIT)
    y1 = min(ideal([(u, H - 1) for u in range(W)])[:, 1].min(), LIMIT)
    fx, fy = (W - 1) / (x1 - x0), (H - 1) / (y1 - y0)
    new = np.array([[fx, 0, -x0 * fx], [0, fy, -y0 * fy], [0, 0, 1]])
    map_x, map_y = cv2.fisheye.initUndistortRectifyMap(K, d, np.eye(3), new, (W, H), cv2.CV_32FC1)
    corrected = np.stack(
        [map_coordinates(image[..., c].astype(np.float64), [map_y, map_x], order=1, mode="nearest") for c in range(3)],
        axis=-1,
    )
    Image.fromarray(np.floor(corrected + 0.5).astype(np.uint8)).save(HERE / f"lens_{name}.png")
    numbers = lambda v: " ".join(repr(float(x)) for x in v)
    lines += [f"lens {name} {numbers(k)} {numbers(d)}", "ours " + numbers([fx, fy, new[0, 2], new[1, 2]])]
(HERE / "lens_fisheye_opencv.txt").write_text("\n".join(lines) + "\n")
print("\n".join(lines))
