"""The peer of `cargo bench -p deepfusion-train --bench step -- every`: a training step of the preset `light` with every
loss, in PyTorch, eager.

pip install torch torchvision
python benches/peers/torch_full_step.py [--threads 2] [--size 320x96] [--batch 4]

Prints the median of ten steps on random images, in both memory layouts. Beside torch_light_step.py's step it decodes the
optical flow of both directions from the depth network's features (torch_flow.py's decoder, its correlation compiled into
one loop, since PyTorch has none), and adds the flow's photometric, consistency and smoothness terms, the affine
invariant loss, the masks of dynamic pixels, and the agreement of flow and rigid flow.
"""
import argparse

import torch
import torch.nn as nn
import torch.nn.functional as F
from torch_correlation import shifted
from torch_flow import FlowDecoder
from torch_light_step import (
    FAR_M,
    LEAST_M,
    METRES,
    NEAR_M,
    SMOOTHNESS,
    SPEED,
    PoseNet,
    length,
    photometric,
    rotation,
    smoothness,
)
from torch_step import CLIP_NORM, LEARNING_RATE, DepthNet, median_ms

FLOW, CONSISTENCY, FLOW_SMOOTHNESS, AGREEMENT, AFFINE = 0.1, 0.1, 0.05, 0.002, 0.01
MARGIN, FLOW_PX, FLOW_SHARE, EPIPOLAR_PX, PARALLAX = 0.02, 1.0, 0.05, 1.0, 1.5


class Geometry:
    """Where pixels go, and what is seen there."""

    def __init__(self, height, width):
        y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
        self.grid = torch.stack([x, y]).float()[None]
        self.homogeneous = torch.stack([x, y, torch.ones_like(x)]).float().reshape(3, -1)
        self.last = torch.tensor([width - 1, height - 1]).float().reshape(1, 2, 1, 1)
        self.size = height, width

    def project(self, inverse_depth, homography, translation):
        n = len(inverse_depth)
        depth = inverse_depth.reshape(n, 1, -1)
        point = homography @ self.homogeneous + translation[:, :, None] * depth
        front = point[:, 2:] > LEAST_M * depth
        pixel = point[:, :2] / torch.where(front, point[:, 2:], 1)
        return torch.where(front, pixel, -1e6).reshape(n, 2, *self.size)

    def valid(self, coords):
        return ((coords >= 0) & (coords <= self.last)).all(1, keepdim=True)

    def warp(self, image, coords):
        grid = (coords / self.last * 2 - 1).permute(0, 2, 3, 1)
        return F.grid_sample(image, grid, padding_mode="border", align_corners=True)


def square(t):
    return t.square().sum(1, keepdim=True)


def mean_where(values, mask):
    return torch.where(mask, values, 0).sum() / (mask.sum().clamp(min=1) * values.shape[1])


def features(net, x):
    r = net.resnet
    x = r.relu(r.bn1(r.conv1((x - 0.45) / 0.225)))
    found = [x]
    x = r.maxpool(x)
    for layer in (r.layer1, r.layer2, r.layer3, r.layer4):
        x = layer(x)
        found.append(x)
    return found


def decode(net, found):
    x, skips, outputs = found[4], found[3::-1], []
    for i in range(5):
        x = F.interpolate(F.elu(net.reduce[i](x)), scale_factor=2)
        if i < 4:
            x = torch.cat([x, skips[i]], 1)
        x = F.elu(net.fuse[i](x))
        if i > 0:
            outputs.append(torch.sigmoid(net.heads[i - 1](x)))
    return outputs[::-1]


def flow_smoothness(flow, image):
    total = 0
    for axis in (2, 3):
        bend = flow.diff(dim=axis, n=2).abs()
        step = image.diff(dim=axis).abs().mean(1, keepdim=True)
        size = step.shape[axis]
        edge = torch.maximum(step.narrow(axis, 0, size - 1), step.narrow(axis, 1, size - 1))
        total = total + (bend * torch.exp(-10 * edge)).mean()
    return total


def epipolar_distance(geometry, ends, r, t, inverse_k):
    x, y, z = t.unbind(1)
    o = torch.zeros_like(x)
    skew = torch.stack([o, -z, y, z, o, -x, -y, x, o], 1).reshape(-1, 3, 3)
    line = (inverse_k.T @ skew @ r @ inverse_k) @ geometry.homogeneous
    line = line.reshape(-1, 3, *geometry.size)
    off = line[:, 0] * ends[:, 0] + line[:, 1] * ends[:, 1] + line[:, 2]
    return (off.abs() / (line[:, 0] ** 2 + line[:, 1] ** 2).sqrt().clamp(min=1e-12))[:, None]


@torch.no_grad()
def moving(geometry, rigid, flow, r, t, k, inverse_k):
    coords, error, valid = rigid
    ends, flow_error, visible = flow
    longest = torch.maximum(square(ends - geometry.grid), square(coords - geometry.grid))
    limit = (longest * FLOW_SHARE**2).clamp(min=FLOW_PX**2)
    found = (flow_error + MARGIN < error) & (square(coords - ends) > limit) & visible & valid
    start = geometry.project(torch.zeros_like(error), k @ r @ inverse_k, torch.zeros_like(t))
    by_flow, by_depth = square(ends - start), square(coords - start)
    along = (by_flow > PARALLAX**2 * by_depth) | (by_depth > PARALLAX**2 * by_flow)
    return found & (along | (epipolar_distance(geometry, ends, r, t, inverse_k) > EPIPOLAR_PX))


def affine_invariant(x, y, valid):
    inside = valid.flatten(1)
    count = inside.sum(1, keepdim=True).clamp(min=1)
    x, y = (torch.where(inside, v.flatten(1), 0) for v in (x, y))
    mean_x, mean_y = (v.sum(1, keepdim=True) / count for v in (x, y))
    dx, dy = (x - mean_x) * inside, (y - mean_y) * inside
    a = (dx * dy).sum(1, keepdim=True) / count / (dx.square().sum(1, keepdim=True) / count + (0.01 * mean_x) ** 2)
    residual = (a * dx - dy).abs().sum(1, keepdim=True) / count
    median = torch.where(inside, y, torch.nan).nanmedian(1, keepdim=True).values.nan_to_num()
    spread = ((y - median).abs() * inside).sum(1, keepdim=True) / count
    return (residual / (spread + 0.01 * median.abs() + 1e-6)).mean()


def step(nets, optimiser, g, first, second, k, inverse_k, distance):
    depth_net, pose_net, flow_net = nets
    n = len(first)
    found = features(depth_net, torch.cat([first, second]))
    flow = flow_net([f[:n] for f in found], [f[n:] for f in found])
    disparities = decode(depth_net, found)
    axis_angle, t = pose_net(torch.cat([first, second], 1))
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

    # The flow's view.
    reverse = torch.cat([flow[n:], flow[:n]])
    ends = flow + g.grid
    flow_error = photometric(g.warp(sources, ends), targets)
    returning = g.warp(reverse, ends)
    with torch.no_grad():
        in_view = g.valid(ends)
        round_trip = square(flow + returning) < 0.01 * (square(flow) + square(returning)) + 0.5
        round_trip &= in_view
        few = round_trip.sum((2, 3), keepdim=True) < 0.5 * in_view.sum((2, 3), keepdim=True)
        visible = in_view & (round_trip | few)
    flow_loss = 2 * mean_where(flow_error, visible)
    flow_loss = flow_loss + 2 * CONSISTENCY * mean_where((flow + returning).abs(), visible)
    flow_loss = flow_loss + FLOW_SMOOTHNESS * flow_smoothness(flow, targets)

    total, masks = FLOW * flow_loss, None
    for scale, disparity in enumerate(disparities):
        large = disparity
        if scale > 0:
            large = F.interpolate(disparity, size=g.size, mode="bilinear", align_corners=False)
        inverse_depth = low + (high - low) * large
        coords = g.project(inverse_depth, k @ r @ inverse_k, (k @ there[:, :, None])[:, :, 0])
        valid = g.valid(coords)
        error = photometric(g.warp(sources, coords), targets)
        if scale == 0:
            masks = moving(g, (coords, error, valid), (ends, flow_error, visible), r, there, k, inverse_k)
            both = valid & visible & ~masks & (error.detach() < unwarped) & (flow_error.detach() < unwarped)
            total = total + AGREEMENT * 2 * mean_where((coords - ends).abs(), both)
            depth = 1 / inverse_depth
            other = g.warp(torch.cat([depth[n:], depth[:n]]), coords)
            row = r.transpose(1, 2)[:, 2:] @ inverse_k
            pixel = torch.cat([coords, torch.ones_like(coords[:, :1])], 1).flatten(2)
            z = other * (row @ pixel).reshape(other.shape)
            z = z - (r.transpose(1, 2) @ there[:, :, None])[:, 2].reshape(-1, 1, 1, 1)
            total = total + AFFINE * affine_invariant(depth, z, valid)
        explained = valid & (error.detach() < unwarped) & ~masks
        total = total + torch.where(explained, error, unwarped).mean() / 4
        total = total + SMOOTHNESS / 2**scale / 4 * smoothness(disparity, pyramid[scale])
    total = total + SPEED * (length(t) - distance).abs().mean()
    optimiser.zero_grad()
    total.backward()
    nn.utils.clip_grad_norm_([p for net in nets for p in net.parameters()], CLIP_NORM)
    optimiser.step()
    return total.item()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--size", default="320x96")
    parser.add_argument("--batch", type=int, default=4)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    width, height = map(int, args.size.split("x"))
    k = torch.tensor([[0.58 * width, 0, width / 2], [0, 1.92 * height, height / 2], [0, 0, 1]])
    distance = torch.full((2 * args.batch,), METRES)
    for layout, name in ((torch.contiguous_format, "NCHW"), (torch.channels_last, "channels last")):
        depth_net, pose_net = DepthNet(18), PoseNet()
        flow_net = FlowDecoder(torch.compile(shifted))
        nets = [net.to(memory_format=layout) for net in (depth_net, pose_net, flow_net)]
        # Disparities of about 10 m, a car that drives ahead, as DeepFusion starts.
        for head in depth_net.heads:
            nn.init.constant_(head[1].bias, -4.6)
        nn.init.zeros_(pose_net.decoder[-1].bias)
        pose_net.decoder[-1].bias.data[5] = -1
        parameters = [p for net in nets for p in net.parameters()]
        optimiser = torch.optim.Adam(parameters, LEARNING_RATE, fused=True)
        first, second = (torch.rand(args.batch, 3, height, width).to(memory_format=layout) for _ in range(2))
        work = nets, optimiser, Geometry(height, width), first, second, k, k.inverse(), distance
        ms = median_ms(lambda: step(*work))
        print(f"training step, preset light, every loss, {args.size}, batch {args.batch}, {name}: {ms:.1f} ms", flush=True)


if __name__ == "__main__":
    main()
