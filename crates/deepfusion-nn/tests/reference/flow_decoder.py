#!/usr/bin/env python3
"""Reference values for the flow decoder, from PyTorch.

    python crates/deepfusion-nn/tests/reference/flow_decoder.py

writes `flow_decoder.safetensors` beside this file: flows of both directions at every size, and the gradients of
Σ flow·pattern, both directions added, with respect to the encoder's features and every weight. Weights and features
are the formulas of networks.py; the computation is in double precision. Of long tensors every `stride`-th value is
kept, as in operations.py.

Needs torch, torchvision (for networks.py) and numpy.
"""

import math

import torch
import torch.nn.functional as F
from networks import HERE, formula, uniform, write_safetensors
from operations import expected, keep, local_correlation, warp
from torch import nn

CHANNELS = (4, 12, 20, 28, 36)
BATCH, HEIGHT, WIDTH = 2, 64, 96
RADIUS, FEATURE_WIDTH, WIDTHS = 4, 16, (24, 20)


def enlarged(flow, factor):
    return factor * F.interpolate(flow, scale_factor=factor, mode="bilinear", align_corners=False)


def coordinates(flow):
    y, x = torch.meshgrid(*(torch.arange(s).double() for s in flow.shape[2:]), indexing="ij")
    return flow + torch.stack([x, y])


class Level(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.project = nn.Conv2d(channels, FEATURE_WIDTH, 1)
        inputs = [(2 * RADIUS + 1) ** 2 + FEATURE_WIDTH + 2, *WIDTHS]
        pairs = zip(inputs, inputs[1:])
        self.hidden = nn.ModuleList(nn.Conv2d(i, o, 3, padding=1) for i, o in pairs)
        self.output = nn.Conv2d(inputs[-1], 2, 3, padding=1)

    def features(self, x):
        x = self.project(x)
        return x / torch.sqrt((x * x).mean(1, keepdim=True) + 1e-6)

    def forward(self, first, second, flow):
        first, second = self.features(first), self.features(second)
        if flow is None:
            flow = torch.zeros_like(first[:, :2])
        else:
            second = warp(second, coordinates(flow))
        x = torch.cat([local_correlation(first, second, radius=RADIUS), first, flow], 1)
        for conv in self.hidden:
            x = F.elu(conv(x))
        return flow + self.output(x)


class FlowDecoder(nn.Module):
    def __init__(self):
        super().__init__()
        self.levels = nn.ModuleList(Level(CHANNELS[3 - level]) for level in range(3))

    def forward(self, first, second):
        flows = []
        for index, level in enumerate(self.levels):
            flow = enlarged(flows[-1], 2) if flows else None
            flows.append(level(first[3 - index], second[3 - index], flow))
        return [*flows, enlarged(flows[-1], 4)]


def features(name):
    shapes = [(BATCH, c, HEIGHT >> (k + 1), WIDTH >> (k + 1)) for k, c in enumerate(CHANNELS)]
    values = [uniform(f"{name}{k}", math.prod(shape), None).reshape(shape) for k, shape in enumerate(shapes)]
    return [torch.from_numpy(v).double().requires_grad_() for v in values]


def main():
    decoder = FlowDecoder()
    state = decoder.state_dict()
    decoder.load_state_dict({name: formula(name, tuple(t.shape), None) for name, t in state.items()})
    decoder.double()
    frames = {"first": features("first"), "second": features("second")}
    loss = 0
    for direction, pair in (("there", ("first", "second")), ("back", ("second", "first"))):
        flows = decoder(*(frames[frame] for frame in pair))
        for name, flow in zip(("level0", "level1", "level2", "flow"), flows):
            keep(f"{direction}/{name}", flow)
        pattern = uniform(f"{direction}/pattern", flows[-1].numel(), None).reshape(flows[-1].shape)
        loss = loss + (flows[-1] * torch.from_numpy(pattern).double()).sum()
    loss.backward()
    for frame, tensors in frames.items():
        for k in (1, 2, 3):
            keep(f"{frame}{k}", tensors[k].grad)
    for name, parameter in decoder.named_parameters():
        keep(name, parameter.grad)
    write_safetensors(HERE / "flow_decoder.safetensors", expected)
    for name, array in expected.items():
        print(f"{name}: {array.size} values, rms {math.sqrt((array**2).mean()):.3f}")


if __name__ == "__main__":
    main()
