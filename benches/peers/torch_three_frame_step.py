"""The peer of a step of `deepfusion train --preset lite-mono` (or another of the field's) in PyTorch, eager.

pip install torch torchvision numpy
python benches/peers/torch_three_frame_step.py [--network lite-mono] [--threads 2] [--size 320x96] [--batch 4] [--autocast]

Prints the median of ten steps on random images, in both memory layouts. A step is: disparities of the middle frame (the network of
crates/deepfusion-nn/tests/reference), motion to both neighbours (ResNet-18 on six channels, both pairs in one batch), both neighbours seen from
the middle frame for each disparity, enlarged to full size, the least of SSIM + L1 over them and over the neighbours as they are (automask),
smoothness at each scale's size, speed loss, backward, gradient clipping, fused AdamW. With --autocast the networks run in bf16 as torch.autocast
chooses.
"""
import argparse
import sys
from pathlib import Path

import torch
import torch.nn as nn
import torch.nn.functional as F
from torch_light_step import (
    FAR_M, METRES, NEAR_M, SMOOTHNESS, SPEED, PoseNet, Views, length, photometric, rotation, smoothness,
)
from torch_step import CLIP_NORM, DepthNet, median_ms

sys.path.insert(0, str(Path(__file__).parents[2] / "crates/deepfusion-nn/tests/reference"))
import lite_mono  # noqa: E402

LEARNING_RATE, WEIGHT_DECAY = 5e-4, 1e-2


class FinestFirst(DepthNet):
    def forward(self, x):
        return super().forward(x)[::-1]


def network(name):
    if name == "monodepth2":
        return FinestFirst(18)
    # The formula's weights are of the size of trained ones, and repeat, which changes no time.
    return nn.Sequential(*lite_mono.build(name, lite_mono.PERIOD)).float()


def step(depth_net, pose_net, optimiser, views, target, sources, k, inverse_k, distance, autocast):
    before, after = sources
    with torch.autocast(target.device.type, torch.bfloat16, enabled=autocast):
        disparities = depth_net(target)
        axis_angle, t = pose_net(torch.cat([torch.cat([before, target], 1), torch.cat([target, after], 1)]))
    disparities = [disparity.float() for disparity in disparities]
    r, t = rotation(axis_angle.float()), t.float()
    backward, forward = r.split(len(target))
    to_target, from_target = t.split(len(target))
    back = backward.transpose(1, 2)
    motions = [(back, -(back @ to_target[:, :, None])[:, :, 0]), (forward, from_target)]
    with torch.no_grad():
        still = torch.cat([photometric(source, target) for source in sources], 1)
        pyramid = [target]
        for _ in disparities[1:]:
            pyramid.append(F.avg_pool2d(pyramid[-1], 2))
    low, high = 1 / FAR_M, 1 / NEAR_M
    scales, total = len(disparities), 0
    for scale, disparity in enumerate(disparities):
        large = disparity
        if disparity.shape[2:] != views.size:
            large = F.interpolate(disparity, size=views.size, mode="bilinear", align_corners=False)
        errors = [still]
        for source, motion in zip(sources, motions):
            warped, valid = views(source, low + (high - low) * large, *motion, k, inverse_k)
            errors.append(torch.where(valid, photometric(warped, target), torch.inf))
        total = total + torch.cat(errors, 1).min(1)[0].mean() / scales
        total = total + SMOOTHNESS / 2**scale / scales * smoothness(disparity, pyramid[scale])
    total = total + SPEED * (length(t) - distance).abs().mean()
    optimiser.zero_grad()
    total.backward()
    nn.utils.clip_grad_norm_([*depth_net.parameters(), *pose_net.parameters()], CLIP_NORM)
    optimiser.step()
    return total.item()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--network", choices=["monodepth2", *lite_mono.MODELS], default="lite-mono")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--size", default="320x96")
    parser.add_argument("--batch", type=int, default=4)
    parser.add_argument("--autocast", action="store_true")
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    width, height = map(int, args.size.split("x"))
    k = torch.tensor([[0.58 * width, 0, width / 2], [0, 1.92 * height, height / 2], [0, 0, 1]])
    distance = torch.full((2 * args.batch,), METRES)
    for layout, name in ((torch.contiguous_format, "NCHW"), (torch.channels_last, "channels last")):
        depth_net = network(args.network).train().to(memory_format=layout)
        pose_net = PoseNet().to(memory_format=layout)
        # A car that drives ahead.
        nn.init.zeros_(pose_net.decoder[-1].bias)
        pose_net.decoder[-1].bias.data[5] = -1
        parameters = [*depth_net.parameters(), *pose_net.parameters()]
        optimiser = torch.optim.AdamW(parameters, LEARNING_RATE, weight_decay=WEIGHT_DECAY, fused=True)
        target, *sources = (torch.rand(args.batch, 3, height, width).to(memory_format=layout) for _ in range(3))
        work = depth_net, pose_net, optimiser, Views(height, width), target, sources, k, k.inverse(), distance, args.autocast
        ms = median_ms(lambda: step(*work))
        words = ", autocast bf16" if args.autocast else ""
        print(f"training step, {args.network}, {args.size}, batch {args.batch}, {name}{words}: {ms:.1f} ms")


if __name__ == "__main__":
    main()
