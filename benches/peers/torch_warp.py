"""The peer of `cargo bench -p deepfusion-kernels --bench warp`: PyTorch's grid_sample on the same coordinates.

pip install torch
python benches/peers/torch_warp.py [--threads 2]

Prints the median and the least time of forward + backward for image and grid, 4x3x192x640, bilinear, border.
"""
import argparse
import statistics
import time

import torch
import torch.nn.functional as F

BATCH, CHANNELS, HEIGHT, WIDTH = 4, 3, 192, 640


def coordinates():
    """Pixel coordinates of a slow zoom, as grid_sample wants them: [-1, 1] at the centres of the outermost pixels."""
    x, y = torch.arange(WIDTH).float(), torch.arange(HEIGHT).float()
    grids = []
    for n in range(BATCH):
        zoom = 1.02 + 0.01 * n
        u = ((x - 320.0) * zoom + 320.3) / (WIDTH - 1) * 2 - 1
        v = ((y - 96.0) * zoom + 96.2) / (HEIGHT - 1) * 2 - 1
        grids.append(torch.stack([u.expand(HEIGHT, -1), v[:, None].expand(-1, WIDTH)], -1))
    return torch.stack(grids)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--threads", type=int, default=2)
    torch.set_num_threads(parser.parse_args().threads)
    image = torch.rand(BATCH, CHANNELS, HEIGHT, WIDTH, requires_grad=True)
    grid = coordinates().requires_grad_()
    gradient = torch.rand(BATCH, CHANNELS, HEIGHT, WIDTH)
    times = []
    for _ in range(60):
        image.grad = grid.grad = None
        start = time.perf_counter()
        out = F.grid_sample(image, grid, mode="bilinear", padding_mode="border", align_corners=True)
        out.backward(gradient)
        times.append((time.perf_counter() - start) * 1e3)
    times = times[10:]
    print(f"grid_sample forward + backward: median {statistics.median(times):.2f} ms, least {min(times):.2f} ms")


if __name__ == "__main__":
    main()
