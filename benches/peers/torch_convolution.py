"""The peer of `cargo bench -p deepfusion-nn --features vulkan --bench convolution`: the same convolutions in PyTorch on a GPU, by CUDA.

pip install torch
python benches/peers/torch_convolution.py [--device cuda]

Prints microseconds of a forward pass, and of forward and backward together, in f32 (with TF32, as PyTorch does by default, and without) and in
bf16, channels last where that is faster. Medians of five rounds of twenty passes.
"""
import argparse
import statistics
import time

import torch
import torch.nn.functional as F

LAYERS = [  # name, channels in and out, height and width, kernel, stride
    ("layer1", 64, 64, 48, 160, 3, 1),
    ("layer2 3x3/2", 64, 128, 48, 160, 3, 2),
    ("layer2", 128, 128, 24, 80, 3, 1),
    ("layer3", 256, 256, 12, 40, 3, 1),
    ("layer4", 512, 512, 6, 20, 3, 1),
    ("decoder 512-256", 512, 256, 6, 20, 3, 1),
    ("decoder 96-32", 96, 32, 96, 320, 3, 1),
    ("decoder 16-16", 16, 16, 192, 640, 3, 1),
]
IMAGES, PASSES, ROUNDS = 8, 20, 5


def wait(device):
    if device.startswith("cuda"):
        torch.cuda.synchronize()


def microseconds(device, run):
    for _ in range(3):
        run()
    rounds = []
    for _ in range(ROUNDS):
        wait(device)
        begun = time.perf_counter()
        for _ in range(PASSES):
            run()
        wait(device)
        rounds.append((time.perf_counter() - begun) / PASSES * 1e6)
    return statistics.median(rounds)


def timed(device, layer, dtype, layout):
    _, channels, out_channels, height, width, kernel, stride = layer
    x = torch.randn(IMAGES, channels, height, width, device=device, dtype=dtype).to(memory_format=layout)
    w = torch.randn(out_channels, channels, kernel, kernel, device=device, dtype=dtype).to(memory_format=layout)
    x.requires_grad_(), w.requires_grad_()
    y = F.conv2d(x, w, None, stride, kernel // 2)
    weigh = torch.randn_like(y)

    def forward():
        with torch.no_grad():
            F.conv2d(x, w, None, stride, kernel // 2)

    def both():
        torch.autograd.grad(F.conv2d(x, w, None, stride, kernel // 2), (x, w), weigh)

    return microseconds(device, forward), microseconds(device, both)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--device", default="cuda")
    device = parser.parse_args().device
    torch.backends.cudnn.benchmark = True
    print(f"{'layer':16} {'precision':9} {'forward':>9} {'with backward':>14}")
    for layer in LAYERS:
        for name, dtype, tf32 in (("f32", torch.float32, False), ("tf32", torch.float32, True), ("bf16", torch.bfloat16, True)):
            torch.backends.cudnn.allow_tf32 = tf32
            pairs = [timed(device, layer, dtype, layout) for layout in (torch.contiguous_format, torch.channels_last)]
            forward, both = (min(times) for times in zip(*pairs))
            print(f"{layer[0]:16} {name:9} {forward:9.1f} {both:14.1f}", flush=True)


if __name__ == "__main__":
    main()
