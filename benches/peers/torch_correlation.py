"""The peer of `cargo bench -p deepfusion-kernels --bench correlation`: local correlation in PyTorch, which has no
operation of that name.

pip install torch
python benches/peers/torch_correlation.py [--threads 2]

Four ways to write it, the best of which is the peer's figure: unfolded windows times the first image; one shifted
product after another; the same compiled into one loop (torch.compile, where a C++ compiler is there); and windows as
strided views contracted by einsum. Prints the median and the least time of each, forward, and forward + backward for
both images.
"""
import argparse
import statistics
import time

import torch
import torch.nn.functional as F

BATCH, CHANNELS, RADIUS = 8, 32, 4
SIZES = [(24, 80), (12, 40), (6, 20), (48, 160)]


def unfolded(a, b):
    n, c, h, w = a.shape
    windows = F.unfold(b, 2 * RADIUS + 1, padding=RADIUS).reshape(n, c, -1, h, w)
    return (a[:, :, None] * windows).mean(1)


def shifted(a, b):
    _, _, h, w = a.shape
    b = F.pad(b, [RADIUS] * 4)
    side = 2 * RADIUS + 1
    return torch.stack([(a * b[:, :, d // side :, d % side :][:, :, :h, :w]).mean(1) for d in range(side**2)], 1)


def strided(a, b):
    n, c, h, w = a.shape
    windows = F.pad(b, [RADIUS] * 4).unfold(2, h, 1).unfold(3, w, 1)
    return torch.einsum("nchw,ncijhw->nijhw", a, windows).reshape(n, -1, h, w) / c


def measure(work, runs=40):
    for _ in range(5):
        work()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        times.append((time.perf_counter() - start) * 1e3)
    return f"median {statistics.median(times):.2f} ms, least {min(times):.2f} ms"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--threads", type=int, default=2)
    torch.set_num_threads(parser.parse_args().threads)
    for height, width in SIZES:
        a = torch.rand(BATCH, CHANNELS, height, width, requires_grad=True)
        b = torch.rand(BATCH, CHANNELS, height, width, requires_grad=True)
        gradient = torch.rand(BATCH, (2 * RADIUS + 1) ** 2, height, width)
        expected = unfolded(a, b)
        ways = {"unfold": unfolded, "shifted": shifted, "einsum": strided, "compiled": torch.compile(shifted)}
        for name, way in ways.items():

            def both():
                a.grad = b.grad = None
                way(a, b).backward(gradient)

            try:
                torch.testing.assert_close(way(a, b), expected)
                size = f"{BATCH}x{CHANNELS}x{height}x{width}"
                with torch.no_grad():
                    forward = measure(lambda: way(a, b))
                print(f"{size} {name}: forward {forward}; forward + backward {measure(both)}", flush=True)
            except Exception as error:  # torch.compile without a compiler
                print(f"{name}: not run ({type(error).__name__})")


if __name__ == "__main__":
    main()
