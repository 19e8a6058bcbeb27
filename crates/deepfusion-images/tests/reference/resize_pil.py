"""Images resized by PIL's LANCZOS, the reference for `resize_rgb`. Run in this folder: python resize_pil.py

Writes resize_source.png and resize_<width>x<height>.png (Pillow 13.0.0, NumPy 2.4.6). The source has what
separates resizers: noise (antialiasing), hard edges (ringing, clamping), a gradient (half-pixel centres).
"""
import numpy as np
from PIL import Image

WIDTH, HEIGHT = 96, 64
y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
rng = np.random.default_rng(7)
image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
image[..., 0] = x * 255 // (WIDTH - 1)
image[..., 1] = np.where((x // 5 + y // 7) % 2, 255, 0)
image[..., 2] = rng.integers(0, 256, (HEIGHT, WIDTH))
source = Image.fromarray(image)
source.save("resize_source.png")
for size in [(32, 24), (41, 13), (150, 70), (96, 20)]:
    source.resize(size, Image.LANCZOS).save(f"resize_{size[0]}x{size[1]}.png")
