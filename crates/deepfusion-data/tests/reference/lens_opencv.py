"""A distorted image and its correction by OpenCV and SciPy, for crates/deepfusion-data/tests/lens.rs.

Needs: opencv-python, numpy, scipy, pillow. Run: python lens_opencv.py (writes lens_*.png and lens_opencv.txt beside it)

The corrected camera sees the largest rectangle of rays that are all in the image, from cv2.undistortPoints of every
pixel of the border; cv2.getOptimalNewCameraMatrix(alpha=0) looks at 9 points a side only, and is written beside it.
The map is cv2.initUndistortRectifyMap's. SciPy interpolates: cv2.remap rounds coordinates to 1/32 pixel.
"""
from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from scipy.ndimage import map_coordinates

HERE = Path(__file__).parent
W, H = 96, 64
K = np.array([[70.0, 0, 49.5], [0, 68.0, 30.0], [0, 0, 1]])
LENSES = {
    "barrel": [-0.28, 0.07, 0.0004, -0.0003],
    "pincushion": [0.15, 0.02, -0.002, 0.001, 0.01],
}
rng = np.random.default_rng(7)
noise = rng.uniform(0, 255, (H // 4, W // 4, 3)).astype(np.float32)
image = np.clip(cv2.resize(noise, (W, H), interpolation=cv2.INTER_CUBIC), 0, 255).round().astype(np.uint8)
Image.fromarray(image).save(HERE / "lens_source.png")
lines = ["K " + " ".join(repr(float(v)) for v in [K[0, 0], K[1, 1], K[0, 2], K[1, 2]])]
for name, coefficients in LENSES.items():
    d = np.array(coefficients)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)

    def ideal(pixels):
        pixels = np.array(pixels, dtype=np.float64).reshape(-1, 1, 2)
        return cv2.undistortPoints(pixels, K, d, criteria=criteria).reshape(-1, 2)

    x0 = ideal([(0, v) for v in range(H)])[:, 0].max()
    x1 = ideal([(W - 1, v) for v in range(H)])[:, 0].min()
    y0 = ideal([(u, 0) for u in range(W)])[:, 1].max()
    y1 = ideal([(u, H - 1) for u in range(W)])[:, 1].min()
    fx, fy = (W - 1) / (x1 - x0), (H - 1) / (y1 - y0)
    new = np.array([[fx, 0, -x0 * fx], [0, fy, -y0 * fy], [0, 0, 1]])
    theirs, _ = cv2.getOptimalNewCameraMatrix(K, d, (W, H), 0)
    map_x, map_y = cv2.initUndistortRectifyMap(K, d, None, new, (W, H), cv2.CV_32FC1)
    corrected = np.stack(
        [map_coordinates(image[..., c].astype(np.float64), [map_y, map_x], order=1, mode="nearest") for c in range(3)],
        axis=-1,
    )
    Image.fromarray(np.floor(corrected + 0.5).astype(np.uint8)).save(HERE / f"lens_{name}.png")
    numbers = lambda m: " ".join(repr(float(v)) for v in [m[0, 0], m[1, 1], m[0, 2], m[1, 2]])
    lines += [f"lens {name} " + " ".join(repr(c) for c in coefficients), "ours " + numbers(new), "opencv " + numbers(theirs)]
(HERE / "lens_opencv.txt").write_text("\n".join(lines) + "\n")
print("\n".join(lines))
