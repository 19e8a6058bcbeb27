"""The peer of `cargo bench -p deepfusion-train -- light`: a training step of the preset `light` in PyTorch, eager.

pip install torch torchvision
python benches/peers/torch_light_step.py [--threads 2] [--size 320x96] [--batch 4] [--autocast] [--depth 18] [--device cpu] [--compile] [--json]

Prints the median of ten steps on random images, in both memory layouts. A step is: depth of both frames (ResNet-18, four
scales), motion of the pair (ResNet-18 on six channels) and its inverse, the views of both frames at the measured distance
for four disparities enlarged to full size, SSIM + L1 with auto-mask, smoothness at each scale's size, speed loss,
backward, gradient clipping, fused Adam. With --autocast the two networks run in bf16 as torch.autocast chooses, with --depth 50 both are
ResNet-50 (the preset `resnet50`), with --compile they go through torch.compile. --json prints the better layout's images a second.
"""
import argparse
import json

import torch
import torch.nn as nn
import torch.nn.functional as F
import torchvision
from torch_step import CLIP_NORM, LEARNING_RATE, DepthNet, median_ms

ALPHA, SMOOTHNESS, SPEED = 0.85, 1e-3, 0.2
NEAR_M, FAR_M, LEAST_M = 0.1, 90.0, 1e-3
RADIANS, METRES = 0.01, 0.8  # per unit of PoseNet's output


class PoseNet(nn.Module):
    """Axis-angle and translation of a pair of images stacked in time order."""

    def __init__(self, depth=18):
        super().__init__()
        self.resnet = getattr(torchvision.models, f"resnet{depth}")()
        self.resnet.conv1 = nn.Conv2d(6, 64, 7, 2, 3, bias=False)
        self.decoder = nn.Sequential(
            nn.Conv2d(512 if depth < 50 else 2048, 256, 1),
            nn.ReLU(),
            nn.Conv2d(256, 256, 3, padding=1),
            nn.ReLU(),
            nn.Conv2d(256, 256, 3, padding=1),
            nn.ReLU(),
            nn.Conv2d(256, 6, 1),
        )

    def forward(self, pair):
        r = self.resnet
        x = r.maxpool(r.relu(r.bn1(r.conv1((pair - 0.45) / 0.225))))
        pose = self.decoder(r.layer4(r.layer3(r.layer2(r.layer1(x))))).mean((2, 3))
        return RADIANS * pose[:, :3], METRES * pose[:, 3:]


def rotation(v):
    """Rodrigues' formula."""
    angle = (v.square().sum(1) + 1e-12).sqrt()[:, None, None]
    x, y, z = v.unbind(1)
    o = torch.zeros_like(x)
    skew = torch.stack([o, -z, y, z, o, -x, -y, x, o], 1).reshape(-1, 3, 3)
    return torch.eye(3) + skew * (angle.sin() / angle) + skew @ skew * ((1 - angle.cos()) / angle**2)


def length(t):
    return (t.square().sum(1) + 1e-8).sqrt()


def photometric(a, b):
    def mean(t):
        return F.avg_pool2d(t, 3, 1)

    a1, b1 = F.pad(a, (1, 1, 1, 1), mode="reflect"), F.pad(b, (1, 1, 1, 1), mode="reflect")
    mu_a, mu_b = mean(a1), mean(b1)
    aa, bb, ab = mu_a * mu_a, mu_b * mu_b, mu_a * mu_b
    var_a, var_b, covariance = mean(a1 * a1) - aa, mean(b1 * b1) - bb, mean(a1 * b1) - ab
    ssim = (2 * ab + 1e-4) * (2 * covariance + 9e-4) / ((aa + bb + 1e-4) * (var_a + var_b + 9e-4))
    error = ALPHA * ((1 - ssim) / 2).clamp(0, 1) + (1 - ALPHA) * (a - b).abs()
    return error.mean(1, keepdim=True)


def smoothness(disparity, image):
    normalised = disparity / (disparity.mean((2, 3), keepdim=True) + 1e-7)
    total = 0
    for axis in (2, 3):
        edge = image.diff(dim=axis).abs().mean(1, keepdim=True)
        total = total + (normalised.diff(dim=axis).abs() * torch.exp(-edge)).mean()
    return total


class Views:
    """Sees the sources from the targets' place."""

    def __init__(self, height, width):
        y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
        self.pixels = torch.stack([x, y, torch.ones_like(x)]).float().reshape(3, -1)
        self.last = torch.tensor([width - 1, height - 1]).float()
        self.size = height, width

    def __call__(self, sources, inverse_depth, r, t, k, inverse_k):
        n = len(sources)
        depth = inverse_depth.reshape(n, 1, -1)
        point = (k @ r @ inverse_k) @ self.pixels + (k @ t[:, :, None]) * depth
        front = point[:, 2:] > LEAST_M * depth
        pixel = point[:, :2] / torch.where(front, point[:, 2:], 1)
        pixel = torch.where(front, pixel, -1e6).reshape(n, 2, *self.size).permute(0, 2, 3, 1)
        valid = ((pixel >= 0) & (pixel <= self.last)).all(3)[:, None]
        grid = pixel / self.last * 2 - 1
        return F.grid_sample(sources, grid, padding_mode="border", align_corners=True), valid


def step(depth_net, pose_net, optimiser, views, first, second, k, inverse_k, distance, autocast):
    with torch.autocast(first.device.type, torch.bfloat16, enabled=autocast):
        disparities = depth_net(torch.cat([first, second]))[::-1]  # the finest first
        axis_angle, t = pose_net(torch.cat([first, second], 1))
    disparities = [disparity.float() for disparity in disparities]
    axis_angle, t = axis_angle.float(), t.float()
    r = rotation(axis_angle)
    back = r.transpose(1, 2)
    r, t = torch.cat([r, back]), torch.cat([t, -(back @ t[:, :, None])[:, :, 0]])
    with torch.no_grad():
        targets, sources = torch.cat([first, second]), torch.cat([second, first])
        unwarped = photometric(sources, targets)
        pyramid = [targets]
        for _ in disparities[1:]:
            pyramid.append(F.avg_pool2d(pyramid[-1], 2))
    there = t * (distance / length(t))[:, None]
    low, high = 1 / FAR_M, 1 / NEAR_M
    total = 0
    for scale, disparity in enumerate(disparities):
        large = disparity
        if scale > 0:
            large = F.interpolate(disparity, size=views.size, mode="bilinear", align_corners=False)
        warped, valid = views(sources, low + (high - low) * large, r, there, k, inverse_k)
        error = photometric(warped, targets)
        explained = valid & (error.detach() < unwarped)
        total = total + torch.where(explained, error, unwarped).mean() / 4
        total = total + SMOOTHNESS / 2**scale / 4 * smoothness(disparity, pyramid[scale])
    total = total + SPEED * (length(t) - distance).abs().mean()
    optimiser.zero_grad()
    total.backward()
    parameters = [*depth_net.parameters(), *pose_net.parameters()]
    nn.utils.clip_grad_norm_(parameters, CLIP_NORM)
    optimiser.step()
    return total.item()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--size", default="320x96")
    parser.add_argument("--batch", type=int, default=4)
    parser.add_argument("--autocast", action="store_true")
    parser.add_argument("--depth", type=int, choices=[18, 50], default=18)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--compile", action="store_true")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    torch.set_default_device(args.device)
    fastest = float("inf")
    width, height = map(int, args.size.split("x"))
    k = torch.tensor([[0.58 * width, 0, width / 2], [0, 1.92 * height, height / 2], [0, 0, 1]])
    distance = torch.full((2 * args.batch,), METRES)
    for layout, name in ((torch.contiguous_format, "NCHW"), (torch.channels_last, "channels last")):
        depth_net = DepthNet(args.depth).to(memory_format=layout)
        pose_net = PoseNet(args.depth).to(memory_format=layout)
        # Disparities of about 10 m, a car that drives ahead, as DeepFusion starts.
        for head in depth_net.heads:
            nn.init.constant_(head[1].bias, -4.6)
        nn.init.zeros_(pose_net.decoder[-1].bias)
        pose_net.decoder[-1].bias.data[5] = -1
        optimiser = torch.optim.Adam([*depth_net.parameters(), *pose_net.parameters()], LEARNING_RATE, fused=True)
        first, second = (torch.rand(args.batch, 3, height, width).to(memory_format=layout) for _ in range(2))
        views = Views(height, width)
        if args.compile:
            depth_net, pose_net = torch.compile(depth_net), torch.compile(pose_net)
        work = depth_net, pose_net, optimiser, views, first, second, k, k.inverse(), distance, args.autocast
        ms = median_ms(lambda: step(*work))
        fastest = min(fastest, ms)
        if args.json:
            continue
        preset = "light" if args.depth == 18 else "resnet50"
        words = (", autocast bf16" if args.autocast else "") + (", compiled" if args.compile else "")
        print(f"training step, preset {preset}, {args.size}, batch {args.batch}, {name}{words}: {ms:.1f} ms")
    if args.json:
        # Two frames a sample.
        print(json.dumps({"ms": fastest, "images_per_second": 2e3 * args.batch / fastest}))


if __name__ == "__main__":
    main()
