#!/usr/bin/env python3
"""Monodepth2's whole training step, and twenty of them, from PyTorch.

    python crates/deepfusion-train/tests/reference/monodepth2_step.py

writes `monodepth2_step.safetensors` beside this file. Three frames, ResNet-18, the networks and weights of
`deepfusion-nn/tests/reference/networks.py` as its `.pth` files hold them, batch norms in training mode; disparities at
four scales, poses in time order and inverted, warps, minimum reprojection with automask, smoothness, backward, Adam.
Everything in double precision from float32 weights and images; gradients and the twenty losses in float32 as well, to
show how far rounding alone carries them.

Two things differ from Monodepth2's published training, here and in the program: both pairs pass the pose encoder in one
batch, so that its batch norms see them together; and a source that does not see a pixel does not explain it (there, its
border-padded warp takes part in the minimum). `main` prints what each does to the loss.

Needs torch, torchvision and numpy.
"""

import math
import sys
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2] / "deepfusion-nn/tests/reference"))
from networks import PERIOD, DepthDecoder, Encoder, PoseDecoder, fill, write_safetensors  # noqa: E402
from photometric import photometric  # noqa: E402

N, H, W = 2, 64, 96
OFFSETS = (-1, 1)
NEAR, FAR = 0.1, 100.0
SMOOTHNESS, STEPS = 1e-3, 20
# Batch norms over twelve values make steep networks: at this rate they learn most of the way, and rounding stays small.
LEARNING_RATE = 5e-7


def picture(offset):
    """The frame at an offset in time, N×3×H×W in (0, 1): waves that pass by as the camera drives."""
    n, c, v, u = np.meshgrid(*map(np.arange, (N, 3, H, W)), indexing="ij")
    x = u + 1.7 * offset * (1 + 0.3 * n)
    waves = 0.5 + 0.22 * np.sin(0.31 * x + 0.17 * v + c + n) + 0.2 * np.cos(0.13 * x - 0.23 * v + 2 * c + 0.7 * n)
    return torch.from_numpy(waves.astype(np.float32))


def camera():
    return torch.tensor([[0.58 * W, 0, 0.5 * W], [0, 1.92 * H, 0.5 * H], [0, 0, 1]], dtype=torch.float64).float()


def rotation(v):
    theta = (v.square().sum(1) + 1e-12).sqrt()[:, None, None]
    x, y, z = v.unbind(1)
    o = torch.zeros_like(x)
    skew = torch.stack([o, -z, y, z, o, -x, -y, x, o], 1).reshape(-1, 3, 3)
    eye = torch.eye(3, dtype=v.dtype)
    return eye + skew * (theta.sin() / theta) + skew @ skew * ((1 - theta.cos()) / theta**2)


def warp(source, inverse_depth, turn, step, k):
    v, u = torch.meshgrid(torch.arange(H), torch.arange(W), indexing="ij")
    rays = torch.linalg.inv(k.double()).to(k) @ torch.stack([u, v, torch.ones_like(u)]).reshape(3, -1).to(k)
    points = rays[None] / inverse_depth.reshape(N, 1, -1)
    seen = k @ (turn @ points + step[:, :, None])
    assert seen[:, 2].min() > 1e-2, "everything is ahead of every camera"
    u, v = (seen[:, :2] / seen[:, 2:]).reshape(N, 2, H, W).unbind(1)
    grid = torch.stack([2 * u / (W - 1) - 1, 2 * v / (H - 1) - 1], -1)
    inside = ((u >= 0) & (u <= W - 1) & (v >= 0) & (v <= H - 1))[:, None]
    return F.grid_sample(source, grid, "bilinear", "border", align_corners=True), inside


def smoothness(disparity, image):
    d = disparity / (disparity.mean((2, 3), keepdim=True) + 1e-7)

    def along(axis):
        return (d.diff(dim=axis).abs() * (-image.diff(dim=axis).abs().mean(1, keepdim=True)).exp()).mean()

    return along(3) + along(2)


class Networks:
    def __init__(self, dtype):
        self.encoder = fill(Encoder(18), PERIOD).to(dtype).train()
        self.depth = fill(DepthDecoder(self.encoder.channels), PERIOD).to(dtype).train()
        self.pose_encoder = fill(Encoder(18, frames=2), PERIOD).to(dtype).train()
        self.pose = fill(PoseDecoder(self.encoder.channels), PERIOD).to(dtype).train()
        self.dtype = dtype

    def parameters(self):
        parts = (self.encoder, self.depth, self.pose_encoder, self.pose)
        return [p for part in parts for p in part.parameters()]

    def compared(self):
        """Weights from the beginning to the end of the two chains, whose gradients are kept."""
        encoder, decoder = self.encoder.encoder, self.depth.decoder
        pose_encoder, pose = self.pose_encoder.encoder, self.pose.net
        return {
            "depth.encoder.conv1": encoder.conv1.weight,
            "depth.encoder.layer2.0.conv1": encoder.layer2[0].conv1.weight,
            "depth.encoder.layer4.1.bn2": encoder.layer4[1].bn2.weight,
            "depth.decoder.stages.0.reduce": decoder[0].conv.conv.weight,
            "depth.decoder.heads.0": decoder[10].conv.weight,
            "depth.decoder.heads.3": decoder[13].conv.weight,
            "pose.encoder.conv1": pose_encoder.conv1.weight,
            "pose.encoder.layer3.1.conv2": pose_encoder.layer3[1].conv2.weight,
            "pose.decoder.squeeze": pose[0].weight,
            "pose.decoder.output": pose[3].weight,
        }

    def raw_poses(self, target, sources, together):
        pairs = [torch.cat([s, target] if o < 0 else [target, s], 1) for o, s in zip(OFFSETS, sources)]
        run = lambda pair: self.pose(self.pose_encoder(pair))  # noqa: E731
        raw = run(torch.cat(pairs)).split(N) if together else [run(pair) for pair in pairs]
        return [0.01 * r[:, :6] for r in raw]

    def step(self, together=True, only_seen=True):
        target, *sources = [picture(o).to(self.dtype) for o in (0, *OFFSETS)]
        k = camera().to(self.dtype)
        disparities = self.depth(self.encoder(target))
        motions = []
        for offset, raw in zip(OFFSETS, self.raw_poses(target, sources, together)):
            turn, step = rotation(raw[:, :3]), raw[:, 3:]
            if offset < 0:
                turn = turn.mT
                step = -(turn @ step[:, :, None])[:, :, 0]
            motions.append((turn, step))

        still = torch.cat([photometric(source, target) for source in sources], 1).detach()
        image, loss, terms = target, 0.0, [0.0, 0.0]
        for scale, sigma in enumerate(disparities):
            if scale > 0:
                image = F.avg_pool2d(image, 2)
            full = F.interpolate(sigma, (H, W), mode="bilinear", align_corners=False)
            inverse_depth = 1 / FAR + (1 / NEAR - 1 / FAR) * full
            errors = []
            for source, (turn, step) in zip(sources, motions):
                warped, inside = warp(source, inverse_depth, turn, step, k)
                error = photometric(warped, target)
                errors.append(torch.where(inside, error, torch.inf) if only_seen else error)
            best, which = torch.cat([still, *errors], 1).min(1)
            terms[0] = terms[0] + best.mean() / 4
            terms[1] = terms[1] + smoothness(sigma, image) / 2**scale / 4
            if scale == 0:
                explained = (which >= 2).double().mean()
        loss = terms[0] + SMOOTHNESS * terms[1]
        return loss, terms, disparities, motions, explained


def train(dtype):
    networks = Networks(dtype)
    adam = torch.optim.Adam(networks.parameters(), LEARNING_RATE)
    losses = []
    for _ in range(STEPS):
        loss, *_ = networks.step()
        losses.append(loss.item())
        adam.zero_grad()
        loss.backward()
        adam.step()
    return np.array(losses)


def main():
    tensors = {}

    def keep(name, tensor, every=1):
        tensors[name] = tensor.detach().double().flatten()[::every].float().numpy()

    networks = Networks(torch.float64)
    loss, terms, disparities, motions, explained = networks.step()
    loss.backward()
    keep("terms", torch.stack([loss, *terms, explained]))
    for scale, disparity in enumerate(disparities):
        keep(f"disparity{scale}", disparity, 31 if scale == 0 else 11)
    for view, (turn, step) in enumerate(motions):
        keep(f"rotation{view}", turn)
        keep(f"translation{view}", step)
    in_float32 = Networks(torch.float32)
    in_float32.step()[0].backward()
    for (name, parameter), rounded in zip(networks.compared().items(), in_float32.compared().values()):
        gradient = parameter.grad
        keep(f"{name}/norm", gradient.norm().reshape(1))
        every = max(1, gradient.numel() // 23) | 1
        keep(f"{name}/gradient", gradient, every)
        size = gradient.abs().clamp(min=gradient.square().mean().sqrt())
        off = (rounded.grad - gradient).abs() / size
        keep(f"{name}/float32", off.flatten()[::every].max().reshape(1))
        print(f"{name}: float32 off by {tensors[f'{name}/float32'][0]:.1e}")

    exact, rounded = train(torch.float64), train(torch.float32)
    tensors["losses"] = exact.astype(np.float32)
    tensors["losses_float32"] = rounded.astype(np.float32)
    write_safetensors(HERE / "monodepth2_step.safetensors", tensors)

    print("loss, reprojection, smoothness, explained:", tensors["terms"])
    for name, options in {"pairs apart": {"together": False}, "border": {"only_seen": False}}.items():
        other = Networks(torch.float64).step(**options)[0].item()
        print(f"{name}: {other:.6f}, {other / loss.item() - 1:+.2e}")
    for name, (turn, step) in zip(OFFSETS, motions):
        print(name, "step", step.detach().numpy().round(4).tolist())
    print("losses", exact)
    print("float32 off by", np.abs(rounded / exact - 1).max())
    assert math.isfinite(exact[-1])


if __name__ == "__main__":
    main()
