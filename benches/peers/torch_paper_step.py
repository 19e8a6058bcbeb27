"""The peer of `deepfusion train --preset paper`: a step of the preset `paper` in PyTorch, eager.

pip install torch torchvision
python benches/peers/torch_paper_step.py [--threads 2] [--size 640x192] [--batch 2] [--accumulate 6] [--steps 2] [--layout NCHW|channels-last]
    [--device cpu] [--autocast] [--compile] [--json]

Prints the median time of a step on random images in one memory layout and the peak memory of the process (VmHWM, Linux).
A step is `accumulate` batches of: depth of both frames (the paper's network, four scales; the module of
crates/deepfusion-nn/tests/reference/depth_network.py), motion of the pair and of the reversed pair (ResNet-50 on six channels), the
views of both frames with that motion for four disparities enlarged to full size, SSIM + L1 with auto-mask, smoothness at each
scale's size, speed loss, backward; then gradient clipping and fused Adam. Flow and affine losses are left out.
"""
import argparse
import json
import statistics
import sys
import time
from pathlib import Path

import torch
import torch.nn as nn
import torch.nn.functional as F
from torch_light_step import FAR_M, METRES, NEAR_M, SMOOTHNESS, SPEED, Views, length, photometric, rotation, smoothness
from torch_light_step import PoseNet as LightPoseNet
from torch_step import CLIP_NORM, LEARNING_RATE

sys.path.append(str(Path(__file__).parents[2] / "crates/deepfusion-nn/tests/reference"))
from depth_network import DepthNet  # noqa: E402


class PoseNet(LightPoseNet):
    """The same on a ResNet-50."""

    def __init__(self):
        super().__init__(50)


def backward(depth_net, pose_net, views, first, second, k, inverse_k, distance, share, autocast):
    """Forward and backward of one batch, its loss times `share`; with `autocast` the networks run in bf16 as torch.autocast chooses."""
    with torch.autocast(first.device.type, torch.bfloat16, enabled=autocast):
        disparities = depth_net(torch.cat([first, second]))
        pairs = torch.cat([torch.cat([first, second], 1), torch.cat([second, first], 1)])
        axis_angle, t = pose_net(pairs)
    disparities = [disparity.float() for disparity in disparities]
    axis_angle, t = axis_angle.float(), t.float()
    r = rotation(axis_angle)
    with torch.no_grad():
        targets, sources = torch.cat([first, second]), torch.cat([second, first])
        unwarped = photometric(sources, targets)
        pyramid = [targets]
        for _ in disparities[1:]:
            pyramid.append(F.avg_pool2d(pyramid[-1], 2))
    low, high = 1 / FAR_M, 1 / NEAR_M
    total = 0
    for scale, disparity in enumerate(disparities):
        large = disparity
        if scale > 0:
            large = F.interpolate(disparity, size=views.size, mode="bilinear", align_corners=False)
        warped, valid = views(sources, low + (high - low) * large, r, t, k, inverse_k)
        error = photometric(warped, targets)
        explained = valid & (error.detach() < unwarped)
        total = total + torch.where(explained, error, unwarped).mean() / 4
        total = total + SMOOTHNESS / 2**scale / 4 * smoothness(disparity, pyramid[scale])
    total = total + SPEED * (length(t) - distance).abs().mean()
    (total * share).backward()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--size", default="640x192")
    parser.add_argument("--batch", type=int, default=2)
    parser.add_argument("--accumulate", type=int, default=6)
    parser.add_argument("--steps", type=int, default=2)
    parser.add_argument("--layout", choices=["NCHW", "channels-last"], default="channels-last")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--autocast", action="store_true")
    parser.add_argument("--compile", action="store_true")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    torch.set_default_device(args.device)
    width, height = map(int, args.size.split("x"))
    k = torch.tensor([[0.58 * width, 0, width / 2], [0, 1.92 * height, height / 2], [0, 0, 1]])
    distance = torch.full((2 * args.batch,), METRES)
    layout = torch.contiguous_format if args.layout == "NCHW" else torch.channels_last
    depth_net, pose_net = DepthNet().to(memory_format=layout), PoseNet().to(memory_format=layout)
    # Disparities of about 10 m, as DeepFusion starts.
    for head in depth_net.decoder.heads:
        nn.init.constant_(head.bias, -4.6)
    parameters = [*depth_net.parameters(), *pose_net.parameters()]
    optimiser = torch.optim.Adam(parameters, LEARNING_RATE, fused=True)
    first, second = (torch.rand(args.batch, 3, height, width).to(memory_format=layout) for _ in range(2))
    views = Views(height, width)
    if args.compile:
        depth_net, pose_net = torch.compile(depth_net), torch.compile(pose_net)

    def finish():
        """What a GPU was asked for is done."""
        if args.device != "cpu":
            parameters[0].sum().item()

    def step():
        optimiser.zero_grad()
        for _ in range(args.accumulate):
            work = depth_net, pose_net, views, first, second, k, k.inverse(), distance
            backward(*work, 1 / args.accumulate, args.autocast)
        nn.utils.clip_grad_norm_(parameters, CLIP_NORM)
        optimiser.step()

    step()
    finish()
    times = []
    for _ in range(args.steps):
        start = time.perf_counter()
        step()
        finish()
        times.append(time.perf_counter() - start)
    if args.json:
        seconds = statistics.median(times)
        print(json.dumps({"seconds": seconds, "images_per_second": 2 * args.batch * args.accumulate / seconds}))
        return
    lines = Path("/proc/self/status").read_text().splitlines()
    peak = next(int(line.split()[1]) / 1024**2 for line in lines if line.startswith("VmHWM"))
    print(
        f"training step, preset paper, {args.size}, batch {args.batch} x {args.accumulate}, {args.layout}: "
        f"median {statistics.median(times):.2f} s of {args.steps}, peak {peak:.2f} GiB"
    )


if __name__ == "__main__":
    main()
