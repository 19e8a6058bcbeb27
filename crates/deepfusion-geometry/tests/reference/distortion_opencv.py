"""Distorted and undistorted points by OpenCV, for crates/deepfusion-geometry/tests/distortion.rs.

Needs: opencv-python, numpy. Run: python distortion_opencv.py (writes distortion_opencv.txt beside it)

Lines: the lens' name with its coefficients, then x y x' y': an ideal point, and where cv2.projectPoints shows it (a
camera matrix of 1, so that pixels are normalised coordinates). cv2.undistortPoints must lead back, or the line is
left out.
"""
from pathlib import Path

import cv2
import numpy as np

LENSES = {
    "euroc": [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05],
    "opencv_sample": [-0.26637261, -0.038588898, 0.0017831947, -0.00028122100, 0.23839153],
    "pincushion": [0.12, 0.03, -0.004, 0.002, -0.01],
    "rational": [0.35, -0.12, 0.0011, -0.0007, 0.02, 0.62, -0.05, 0.01],
}

lines = []
rng = np.random.default_rng(1)
for name, coefficients in LENSES.items():
    d = np.array(coefficients)
    lines.append(f"lens {name} " + " ".join(repr(float(c)) for c in d))
    ideal = rng.uniform([-0.7, -0.5], [0.7, 0.5], (24, 2))
    rays = np.hstack([ideal, np.ones((len(ideal), 1))])
    seen, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), np.eye(3), d)
    seen = seen.reshape(-1, 2)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)
    back = cv2.undistortPointsIter(seen.reshape(-1, 1, 2), np.eye(3), d, None, None, criteria) if hasattr(
        cv2, "undistortPointsIter") else cv2.undistortPoints(seen.reshape(-1, 1, 2), np.eye(3), d, criteria=criteria)
    back = back.reshape(-1, 2)
    kept = 0
    for i, s, b in zip(ideal, seen, back):
        if np.abs(b - i).max() < 1e-9:
            lines.append(" ".join(f"{v:.17g}" for v in [*i, *s]))
            kept += 1
    print(name, kept, "of", len(ideal))
Path(__file__).with_name("distortion_opencv.txt").write_text("\n".join(lines) + "\n")
