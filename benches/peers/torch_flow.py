"""The peer of `cargo bench -p deepfusion-train --bench flow`: the same flow decoder in PyTorch, on the same threads.

pip install torch
python benches/peers/torch_flow.py [--threads 2]

Prints the median of ten runs of both directions, forward and forward + backward, on features of a ResNet-18, batch 4, in
both memory layouts. The correlation, which PyTorch lacks, is the fastest of torch_correlation.py's: shifted products
compiled into one loop; its second row is the whole decoder compiled.
"""
import argparse
import statistics
import time

import torch
import torch.nn as nn
import torch.nn.functional as F
from torch_correlation import RADIUS, shifted

BATCH, CHANNELS, FEATURE_WIDTH, WIDTHS = 4, (64, 64, 128, 256, 512), 32, (64, 48, 32)
SIZES = [(96, 320), (192, 640)]


def enlarged(flow, factor):
    return factor * F.interpolate(flow, scale_factor=factor, mode="bilinear", align_corners=False)


def warp(image, flow):
    _, _, height, width = flow.shape
    y, x = torch.meshgrid(torch.arange(height).float(), torch.arange(width).float(), indexing="ij")
    last = torch.tensor([width - 1.0, height - 1.0])
    grid = (flow + torch.stack([x, y])).permute(0, 2, 3, 1) / last * 2 - 1
    return F.grid_sample(image, grid, padding_mode="border", align_corners=True)


class Level(nn.Module):
    def __init__(self, channels, correlate):
        super().__init__()
        self.correlate = correlate
        self.project = nn.Conv2d(channels, FEATURE_WIDTH, 1)
        widths = [(2 * RADIUS + 1) ** 2 + FEATURE_WIDTH + 2, *WIDTHS]
        self.hidden = nn.ModuleList(nn.Conv2d(i, o, 3, padding=1) for i, o in zip(widths, widths[1:]))
        self.output = nn.Conv2d(widths[-1], 2, 3, padding=1)
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)

    def features(self, x):
        x = self.project(x)
        return x / torch.sqrt((x * x).mean(1, keepdim=True) + 1e-6)

    def forward(self, first, second, flow):
        a, b = self.features(first), self.features(second)
        first, second = torch.cat([a, b]), torch.cat([b, a])
        if flow is None:
            flow = torch.zeros_like(first[:, :2])
        else:
            second = warp(second, flow)
        x = torch.cat([self.correlate(first, second), first, flow], 1)
        for conv in self.hidden:
            x = F.elu(conv(x))
        return flow + self.output(x)


class FlowDecoder(nn.Module):
    def __init__(self, correlate):
        super().__init__()
        self.levels = nn.ModuleList(Level(CHANNELS[3 - level], correlate) for level in range(3))

    def forward(self, first, second):
        flow = None
        for index, level in enumerate(self.levels):
            flow = None if flow is None else enlarged(flow, 2)
            flow = level(first[3 - index], second[3 - index], flow)
        return enlarged(flow, 4)


def median_ms(work, runs=10):
    work()
    work()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--threads", type=int, default=2)
    torch.set_num_threads(parser.parse_args().threads)
    correlate = torch.compile(shifted)
    for height, width in SIZES:
        for layout, name in ((torch.contiguous_format, "NCHW"), (torch.channels_last, "channels last")):
            features = [
                [
                    torch.rand(BATCH, c, height >> (k + 1), width >> (k + 1))
                    .to(memory_format=layout)
                    .requires_grad_()
                    for k, c in enumerate(CHANNELS)
                ]
                for _ in range(2)
            ]
            decoder = FlowDecoder(correlate).to(memory_format=layout)
            ways = {f"{name}": decoder, f"{name}, compiled": torch.compile(FlowDecoder(shifted).to(memory_format=layout))}
            for way, net in ways.items():

                def both():
                    net.zero_grad()
                    net(*features).mean().backward()

                with torch.no_grad():
                    forward = median_ms(lambda: net(*features))
                what = f"{width}x{height}, batch {BATCH}, {way}"
                print(f"{what}: forward {forward:.1f} ms, forward + backward {median_ms(both):.1f} ms", flush=True)


if __name__ == "__main__":
    main()
