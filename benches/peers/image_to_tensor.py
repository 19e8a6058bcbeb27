"""The peers of `cargo bench -p deepfusion-images --bench image`, on the files that it made: run it first.

pip install numpy opencv-python-headless pillow-simd    (or pillow; CC="cc -mavx2" for pillow-simd with AVX2)
python benches/peers/image_to_tensor.py [FOLDER]

File bytes in memory -> RGB -> 640x192, antialiased -> 3xHxW float32 in [0, 1], on one thread; the median of 200 runs and, for
machines that are shared, the fastest.
Pillow has the same filter as deepfusion, LANCZOS. OpenCV has no antialiased Lanczos: INTER_AREA, the average of the
pixels under each new one, is its antialiased filter, and reads about a sixth of the pixels that Lanczos does.
"""
import io
import os
import statistics
import sys
import tempfile
import time

import cv2
import numpy as np
import PIL
from PIL import Image

SIZE = (640, 192)


def times_ms(work, repeats=200):
    for _ in range(10):
        work()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return f"{statistics.median(times) * 1e3:.2f} (fastest {min(times) * 1e3:.2f})"


def to_chw(pixels):
    chw = np.empty((3, pixels.shape[0], pixels.shape[1]), np.float32)
    np.multiply(pixels.transpose(2, 0, 1), np.float32(1 / 255), out=chw)
    return chw


def pillow_decode(data):
    image = Image.open(io.BytesIO(data))
    return image.convert("RGB")


def pillow(data):
    return to_chw(np.asarray(pillow_decode(data).resize(SIZE, Image.LANCZOS)))


def opencv(data):
    image = cv2.imdecode(data, cv2.IMREAD_COLOR_RGB)
    return to_chw(cv2.resize(image, SIZE, interpolation=cv2.INTER_AREA))


def main():
    default = os.path.join(tempfile.gettempdir(), "deepfusion-bench")
    folder = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("DEEPFUSION_BENCH_DIR", default)
    cv2.setNumThreads(1)
    print(f"Pillow {PIL.__version__}, OpenCV {cv2.__version__}, ms")
    for name in ("street_420.jpg", "street_444.jpg", "street.png"):
        with open(os.path.join(folder, name), "rb") as file:
            data = file.read()
        array = np.frombuffer(data, np.uint8)
        print(name)
        print("  Pillow ", times_ms(lambda: pillow(data)), "  decode alone", times_ms(lambda: pillow_decode(data)))
        decode = times_ms(lambda: cv2.imdecode(array, cv2.IMREAD_COLOR_RGB))
        print("  OpenCV ", times_ms(lambda: opencv(array)), "  decode alone", decode)


if __name__ == "__main__":
    main()
