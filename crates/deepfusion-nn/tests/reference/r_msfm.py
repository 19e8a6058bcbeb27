#!/usr/bin/env python3
"""Reference values for R-MSFM, from PyTorch.

    python crates/deepfusion-nn/tests/reference/r_msfm.py

The networks are rebuilt here from the paper (Zhou et al., "R-MSFM: Recurrent Multi-Scale Feature Modulation for Monocular Depth
Estimating", ICCV 2021), RAFT's gated unit and convex upsampling (Teed and Deng, ECCV 2020), and the names and shapes of the tensors in
the published encoder.pth and depth.pth. It writes, beside this file:

- `r_msfm.json`: names, shapes and types of the tensors in these files, for R-MSFM3 and R-MSFM6;
- `r_msfm.safetensors`: disparities after every refinement, and a training step's gradients, subsampled, computed in double precision
  from the float32 weights.

Needs torch and numpy. Weights and images are those of `formula` in lite_mono.py.
"""

import json

import torch
import torch.nn.functional as F
from torch import nn

from lite_mono import HERE, expected, fill, images, keep, listed, named, uniform, write_safetensors


def basic(inputs, outputs, stride):
    block = dict(
        conv1=nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False),
        bn1=nn.BatchNorm2d(outputs),
        conv2=nn.Conv2d(outputs, outputs, 3, 1, 1, bias=False),
        bn2=nn.BatchNorm2d(outputs),
    )
    if stride != 1:
        block["downsample"] = nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs))
    return named(**block)


def run_basic(block, x):
    short = block.downsample(x) if hasattr(block, "downsample") else x
    y = F.relu(block.bn1(block.conv1(x)))
    return F.relu(block.bn2(block.conv2(y)) + short)


class Encoder(nn.Module):
    """A whole ResNet-18, as in the published file; the features are those up to the second layer."""

    def __init__(self):
        super().__init__()
        layers = {
            f"layer{i + 1}": nn.ModuleList([basic(a, b, stride), basic(b, b, 1)])
            for i, (a, b, stride) in enumerate(((64, 64, 1), (64, 128, 2), (128, 256, 2), (256, 512, 2)))
        }
        self.encoder = named(
            conv1=nn.Conv2d(3, 64, 7, 2, 3, bias=False), bn1=nn.BatchNorm2d(64), **layers, fc=nn.Linear(512, 1000)
        )

    def forward(self, image):
        net, features = self.encoder, []
        x = F.relu(net.bn1(net.conv1((image - 0.45) / 0.225)))
        features.append(x)
        x = F.max_pool2d(x, 3, 2, 1)
        for layer in (net.layer1, net.layer2):
            for block in layer:
                x = run_basic(block, x)
            features.append(x)
        return features


def mirrored(inputs, outputs, kernel=3, stride=1):
    """A padding and its convolution, which is at place 1 of a sequence."""
    return [nn.ReflectionPad2d(kernel // 2), nn.Conv2d(inputs, outputs, kernel, stride)]


def strips():
    return nn.Sequential(
        nn.Conv2d(128, 128, (1, 3), padding=(0, 1)), nn.Tanh(), nn.Conv2d(128, 128, (3, 1), padding=(1, 0)), nn.Tanh()
    )


def block(inputs, outputs):
    return named(conv=named(conv=nn.Conv2d(inputs, outputs, 3, padding=1, padding_mode="reflect")))


class Decoder(nn.Module):
    def __init__(self, iterations):
        super().__init__()
        self.iterations = iterations
        self.convX11 = nn.Sequential(*mirrored(64, 96, stride=2), nn.LeakyReLU(), *mirrored(96, 128, stride=2), nn.Tanh())
        self.convX21 = nn.Sequential(*mirrored(64, 128, stride=2), nn.Tanh())
        self.convX31 = nn.Sequential(*mirrored(128, 128), nn.Tanh())
        if iterations == 6:
            self.convX12, self.convX22, self.convX32 = strips(), strips(), strips()
        gates = {
            f"conv{gate}{i + 1}": nn.Conv2d(256, 128, kernel, padding=padding)
            for i, (kernel, padding) in enumerate((((1, 3), (0, 1)), ((3, 1), (1, 0))))
            for gate in "zrq"
        }
        self.gruc = named(**gates)
        self.update_block = named(
            encoder=named(
                convc1=block(128, 160),
                convc2=block(160, 128),
                convf1=nn.Sequential(*mirrored(1, 64, 7)),
                convf2=nn.Sequential(*mirrored(64, 32)),
                conv=block(160, 191),
            ),
            flow_head=named(
                covd1=nn.Sequential(*mirrored(192, 256)),
                covd2=nn.Sequential(*mirrored(256, 1)),
            ),
            mask=nn.Sequential(*mirrored(192, 324), nn.LeakyReLU(), nn.Conv2d(324, 576, 1)),
        )

    def gru(self, h, x):
        g = self.gruc
        for z, r, q in ((g.convz1, g.convr1, g.convq1), (g.convz2, g.convr2, g.convq2)):
            both = torch.cat([h, x], 1)
            share = torch.sigmoid(z(both))
            kept = torch.sigmoid(r(both)) * h
            h = (1 - share) * h + share * torch.tanh(q(torch.cat([kept, x], 1)))
        return h

    def refine(self, state, logit):
        e, head = self.update_block.encoder, self.update_block.flow_head
        leaky = lambda layer, x: F.leaky_relu(layer(x), 0.01)
        state = leaky(e.convc2.conv.conv, leaky(e.convc1.conv.conv, state))
        depth = leaky(e.convf2, leaky(e.convf1, logit))
        joined = leaky(e.conv.conv.conv, torch.cat([state, depth], 1))
        seen = torch.cat([joined, logit], 1)
        return logit + head.covd2(leaky(head.covd1, seen)), 0.25 * self.update_block.mask(seen)

    def forward(self, features):
        fine, middle, coarse = features
        if self.iterations == 3:
            looks = [lambda _: self.convX31(coarse), lambda _: self.convX21(middle), lambda _: self.convX11(fine)]
        else:
            looks = [
                lambda _: self.convX31(coarse),
                self.convX32,
                lambda _: self.convX21(middle),
                self.convX22,
                lambda _: self.convX11(fine),
                self.convX12,
            ]
        state, found = looks[0](None), []
        logit = torch.zeros_like(state[:, :1])
        for index, look in enumerate(looks):
            if index > 0:
                state = self.gru(state, look(state))
            logit, weights = self.refine(state, logit)
            found.append(convex(torch.sigmoid(logit), weights))
        return found


def convex(small, weights):
    """Each pixel of a block of 8×8 as the mean of its block's 3×3 neighbours, weighted by a softmax."""
    batch, _, height, width = small.shape
    shares = torch.softmax(weights.reshape(batch, 9, 64, height * width), 1)
    around = F.unfold(small, 3, padding=1).reshape(batch, 9, 1, height * width)
    return F.pixel_shuffle((shares * around).sum(1).reshape(batch, 64, height, width), 8)


def build(iterations):
    return fill(Encoder(), None), fill(Decoder(iterations), None)


def training():
    """One training step's forward and backward pass of R-MSFM6: loss = Σ_k mean(σ_k · pattern_k). Also the error of PyTorch's
    own float32 gradients, over the root mean square of each: where tanh is near ±1, 1 − tanh² is mostly rounding error."""

    def step(dtype):
        encoder, decoder = (part.train().to(dtype) for part in build(6))
        loss = 0.0
        for index, disparity in enumerate(reversed(decoder(encoder(images().to(dtype))))):
            pattern = uniform(f"pattern{index}", disparity.numel(), None).reshape(disparity.shape)
            loss = loss + (disparity * torch.from_numpy(pattern).to(dtype)).mean()
        loss.backward()
        return loss, {"encoder": encoder, "depth": decoder}

    loss, exact = step(torch.float64)
    _, single = step(torch.float32)
    keep("training/loss", loss.reshape(1), 1)
    squares = [
        sum(p.grad.double().square().sum() for m in step.values() for p in m.parameters() if p.grad is not None)
        for step in (single, exact)
    ]
    keep("training/float32_total", (squares[0] / squares[1] - 1).abs().reshape(1), 1)
    for part, module in exact.items():
        rounded = dict(single[part].named_parameters())
        for name, parameter in module.named_parameters():
            if parameter.grad is not None:
                off = (rounded[name].grad.double() - parameter.grad).abs().max()
                root = parameter.grad.square().mean().sqrt()
                keep(f"training/{part}/{name}/float32", (off / root).reshape(1), 1)
                keep(f"training/{part}/{name}/norm", parameter.grad.norm().reshape(1), 1)
                keep(f"training/{part}/{name}/gradient", parameter.grad, max(1, parameter.numel() // 11) | 1)


def main():
    manifest = {}
    for iterations in (3, 6):
        model = f"r-msfm{iterations}"
        encoder, decoder = (part.eval() for part in build(iterations))
        manifest[f"{model}/encoder"], manifest[f"{model}/depth"] = listed(encoder), listed(decoder)
        for age, disparity in enumerate(reversed(decoder(encoder(images())))):
            keep(f"{model}/disparity{age}", disparity, 31)
        net = encoder.encoder
        read = (net.conv1, net.bn1, net.layer1, net.layer2, decoder)
        print(f"{model}: {sum(p.numel() for part in read for p in part.parameters())} parameters")
    training()
    write_safetensors(HERE / "r_msfm.safetensors", expected)
    with open(HERE / "r_msfm.json", "w") as file:
        json.dump(manifest, file, separators=(",", ":"))
        file.write("\n")
    for name, array in expected.items():
        if "training" not in name:
            print(f"{name}: {array.size} values, mean {array.mean():.4f}, std {array.std():.4f}")


if __name__ == "__main__":
    main()
