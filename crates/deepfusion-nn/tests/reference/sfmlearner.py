#!/usr/bin/env python3
"""Reference values for DispNet, the depth network of SfMLearner, from PyTorch.

    python crates/deepfusion-nn/tests/reference/sfmlearner.py

The network is rebuilt here from the paper (Zhou et al., "Unsupervised Learning of Depth and Ego-Motion from Video", CVPR 2017, its
figure of the architectures) and from the names and shapes of the tensors in the usual dispnet_model_best.pth.tar. It writes, beside
this file:

- `sfmlearner.json`: names, shapes and types of the tensors in that file;
- `sfmlearner.safetensors`: sigmoid disparities, and a training step's gradients, subsampled, computed in double precision from the
  float32 weights;
- `state_dict.pth`, `state_dict_legacy.pth`: a tensor beside an epoch and an optimiser's state, as training programs save them with the new
  and the old layout of torch.save.

Needs torch and numpy. Weights and images are those of `formula` in lite_mono.py.
"""

import json

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

from lite_mono import BATCH, HERE, SIZE, expected, fill, images, keep, listed, uniform, write_safetensors

HALVED = (32, 64, 128, 256, 512, 512, 512)
DOUBLED = (512, 512, 256, 128, 64, 32, 16)


def halving(inputs, outputs, kernel):
    pad = (kernel - 1) // 2
    first, second = nn.Conv2d(inputs, outputs, kernel, 2, pad), nn.Conv2d(outputs, outputs, kernel, 1, pad)
    return nn.Sequential(first, nn.ReLU(), second, nn.ReLU())


class DispNet(nn.Module):
    def __init__(self):
        super().__init__()
        before = 3
        for level, (width, kernel) in enumerate(zip(HALVED, (7, 5, 3, 3, 3, 3, 3)), 1):
            self.add_module(f"conv{level}", halving(before, width, kernel))
            before = width
        for level, width in zip(range(7, 0, -1), DOUBLED):
            doubling = nn.ConvTranspose2d(before, width, 3, 2, padding=1, output_padding=1)
            self.add_module(f"upconv{level}", nn.Sequential(doubling, nn.ReLU()))
            before = width
        for level, width in zip(range(7, 0, -1), DOUBLED):
            joined = width + (HALVED[level - 2] if level > 1 else 0) + (1 if level < 4 else 0)
            self.add_module(f"iconv{level}", nn.Sequential(nn.Conv2d(joined, width, 3, padding=1), nn.ReLU()))
        for level in (4, 3, 2, 1):
            self.add_module(f"predict_disp{level}", nn.Sequential(nn.Conv2d(DOUBLED[7 - level], 1, 3, padding=1), nn.Sigmoid()))

    def forward(self, image):
        """Sigmoids, finest first; the paper's disparities are 10·σ + 0.01."""
        x, skips = (image - 0.5) / 0.5, [image]
        for level in range(1, 8):
            x = getattr(self, f"conv{level}")(x)
            skips.append(x)
        found = []
        for level in range(7, 0, -1):
            skip = skips[level - 1]
            cut = lambda y: y[:, :, : skip.shape[2], : skip.shape[3]]
            joined = [cut(getattr(self, f"upconv{level}")(x))]
            if level > 1:
                joined.append(skip)
            if level < 4:
                disparity = 10 * found[-1] + 0.01
                joined.append(cut(F.interpolate(disparity, scale_factor=2, mode="bilinear", align_corners=False)))
            x = getattr(self, f"iconv{level}")(torch.cat(joined, 1))
            if level < 5:
                found.append(getattr(self, f"predict_disp{level}")(x))
        return found[::-1]


def build():
    return fill(DispNet(), None)


def clear_of_kinks():
    """The first of many images at which no ReLU reads a value so close to 0 that rounding decides its gradient: none within 5e-6 of the
    root mean square of its input. Returns the number and the images."""
    net, margins = build().eval(), []
    for part in net.modules():
        if isinstance(part, nn.ReLU):
            part.register_forward_pre_hook(lambda _, x: margins.append(x[0].abs().min() / x[0].square().mean().sqrt()))
    for number in range(1000):
        u = uniform(f"images{number}", BATCH * 3 * SIZE[0] * SIZE[1], None) * np.float32(0.5) + np.float32(0.5)
        image = torch.from_numpy(u.reshape(BATCH, 3, *SIZE)).double()
        margins.clear()
        with torch.no_grad():
            net(image)
        if min(margins) > 5e-6:
            return number, image
    raise SystemExit("no such images")


def training():
    """One training step's forward and backward pass: loss = Σ_k mean(σ_k · pattern_k). Also the error of PyTorch's own
    float32 gradients, over the root mean square of each."""
    number, clear = clear_of_kinks()
    keep("training/images", torch.tensor([float(number)]), 1)

    def step(dtype):
        net = build().train().to(dtype)
        loss = 0.0
        for index, disparity in enumerate(net(clear.to(dtype))):
            pattern = uniform(f"pattern{index}", disparity.numel(), None).reshape(disparity.shape)
            loss = loss + (disparity * torch.from_numpy(pattern).to(dtype)).mean()
        loss.backward()
        return loss, net

    loss, exact = step(torch.float64)
    _, single = step(torch.float32)
    keep("training/loss", loss.reshape(1), 1)
    squares = [sum(p.grad.double().square().sum() for p in net.parameters()) for net in (single, exact)]
    keep("training/float32_total", (squares[0] / squares[1] - 1).abs().reshape(1), 1)
    rounded = dict(single.named_parameters())
    for name, parameter in exact.named_parameters():
        off = (rounded[name].grad.double() - parameter.grad).abs().max()
        root = parameter.grad.square().mean().sqrt()
        keep(f"training/{name}/float32", (off / root).reshape(1), 1)
        keep(f"training/{name}/norm", parameter.grad.norm().reshape(1), 1)
        keep(f"training/{name}/gradient", parameter.grad, max(1, parameter.numel() // 11) | 1)


def nested():
    weight = torch.arange(6, dtype=torch.float32).reshape(2, 3)
    saved = {"epoch": 3, "state_dict": {"conv1.0.weight": weight}, "optimizer": {"state": {0: {"exp_avg": weight}}}}
    torch.save(saved, HERE / "state_dict.pth")
    torch.save(saved, HERE / "state_dict_legacy.pth", _use_new_zipfile_serialization=False)


def main():
    net = build().eval()
    with torch.no_grad():
        for scale, disparity in enumerate(net(images())):
            keep(f"disparity{scale}", disparity, 31)
    print(f"{sum(p.numel() for p in net.parameters())} parameters")
    training()
    write_safetensors(HERE / "sfmlearner.safetensors", expected)
    with open(HERE / "sfmlearner.json", "w") as file:
        json.dump({"dispnet": listed(net)}, file, separators=(",", ":"))
        file.write("\n")
    nested()
    for name, array in expected.items():
        if "training" not in name or "float32" in name:
            print(f"{name}: {array.size} values, mean {array.mean():.3g}, std {array.std():.3g}")


if __name__ == "__main__":
    main()
