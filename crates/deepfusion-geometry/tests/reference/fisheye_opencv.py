"""Points through fisheye lenses by OpenCV, for crates/deepfusion-geometry/tests/distortion.rs.

Needs: opencv-python, numpy. Run: python fisheye_opencv.py (writes fisheye_opencv.txt beside it)

Lines: the lens' name with k1, k2, k3, k4, then x y x' y': an ideal point up to 75 degrees from the axis, and where
cv2.fisheye.distortPoints shows it.
"""
from pathlib import Path

import cv2
import numpy as np

LENSES = {
    # TUM VI's cam0, as its camchain gives it.
    "tum_vi": [0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202, 0.00020293673591811182],
    "equidistant": [0.0, 0.0, 0.0, 0.0],
    "action_camera": [0.05, -0.02, 0.01, -0.003],
}

lines = []
rng = np.random.default_rng(3)
for name, coefficients in LENSES.items():
    lines.append(f"lens {name} " + " ".join(repr(c) for c in coefficients))
    theta = np.radians(rng.uniform(0.5, 75.0, 20))
    direction = rng.uniform(0.0, 2 * np.pi, 20)
    ideal = np.tan(theta)[:, None] * np.stack([np.cos(direction), np.sin(direction)], axis=-1)
    seen = cv2.fisheye.distortPoints(ideal.reshape(-1, 1, 2), np.eye(3), np.array(coefficients)).reshape(-1, 2)
    lines += [" ".join(f"{v:.17g}" for v in [*i, *s]) for i, s in zip(ideal, seen)]
Path(__file__).with_name("fisheye_opencv.txt").write_text("\n".join(lines) + "\n")
