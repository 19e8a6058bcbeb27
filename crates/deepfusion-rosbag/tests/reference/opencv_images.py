"""Pixels of the encodings that have to be computed, by OpenCV: another implementation of the same formulas.

pip install opencv-python-headless numpy
python crates/deepfusion-rosbag/tests/reference/opencv_images.py

Writes opencv_images.json beside itself (made with OpenCV 5.0.0): images as a driver publishes them, of random numbers (the harshest picture for an
interpolation), odd and even sizes, rows padded by three bytes of 0xee, and the RGB that OpenCV makes of them as cv_bridge does: its conversions of
ROS's encodings are those of `getConversionCode` in cv_bridge/src/cv_bridge.cpp, 16 bits become 8 by a factor of 255 / 65535.
"""
import json
from pathlib import Path

import cv2
import numpy as np

RNG = np.random.default_rng(20)
PADDING = 3
# ROS names the sensor's upper left pixels. OpenCV's older names (BayerBG for rggb) are those of the second row's second and third.
BAYER = {
    "bayer_rggb8": cv2.COLOR_BayerRGGB2RGB,
    "bayer_bggr8": cv2.COLOR_BayerBGGR2RGB,
    "bayer_gbrg8": cv2.COLOR_BayerGBRG2RGB,
    "bayer_grbg8": cv2.COLOR_BayerGRBG2RGB,
}
YUV = {
    "yuv422": cv2.COLOR_YUV2RGB_UYVY,
    "uyvy": cv2.COLOR_YUV2RGB_UYVY,
    "yuv422_yuy2": cv2.COLOR_YUV2RGB_YUYV,
    "yuyv": cv2.COLOR_YUV2RGB_YUYV,
}


def case(encoding, pixels, rgb, big=False):
    height, width = pixels.shape[:2]
    stored = pixels.astype(">u2" if big else "<u2") if pixels.dtype == np.uint16 else pixels
    rows = [stored[y].tobytes() for y in range(height)]
    return {
        "encoding": encoding,
        "is_bigendian": int(big),
        "width": width,
        "height": height,
        "step": len(rows[0]) + PADDING,
        "data": b"".join(row + b"\xee" * PADDING for row in rows).hex(),
        "rgb": rgb.tobytes().hex(),
    }


def main():
    cases = []
    for encoding, code in BAYER.items():
        for height, width in [(6, 8), (7, 9), (36, 37)]:
            pixels = RNG.integers(0, 256, (height, width), dtype=np.uint8)
            cases.append(case(encoding, pixels, cv2.cvtColor(pixels, code)))
    for encoding, code in YUV.items():
        pixels = RNG.integers(0, 256, (9, 22, 2), dtype=np.uint8)
        cases.append(case(encoding, pixels, cv2.cvtColor(pixels, code)))
    # Both ends, and the numbers beside every edge between two results: 257 k + 128.
    edges = 257 * np.arange(255) + 128
    values = np.sort(np.concatenate([edges, edges + 1, [0, 65535]])).astype(np.uint16).reshape(16, 32)
    grey = cv2.convertScaleAbs(values, alpha=255 / 65535)
    for big in [False, True]:
        cases.append(case("mono16", values, np.repeat(grey[..., None], 3, axis=2), big))
    (Path(__file__).parent / "opencv_images.json").write_text(json.dumps(cases, indent=0) + "\n")
    print(cv2.__version__, len(cases), "images")


main()
