#!/usr/bin/env python3
"""Each network's whole training step, and the losses of twenty steps, from PyTorch.

    python crates/deepfusion-train/tests/reference/whole_step.py [NETWORK...]

writes `whole_step/NETWORK.safetensors` beside this file. The step: three frames; the depth networks of `deepfusion-nn/tests/reference` and
a ResNet for the poses, batch norms in training mode, weights by the formula; disparities, poses in time order and inverted, warps, the
losses, backward, Adam. Everything is in double precision from float32 weights and images. Gradients and the steps' losses are also computed
in float32, with oneDNN's convolutions and with PyTorch's own, to show the effect of rounding alone. `main` fails if a loss is off by more
than a third of 1e-3, the test's tolerance, or if twenty steps change the loss by less than a hundredth.

The losses are the presets' without the speed loss: minimum reprojection with automask and smoothness (Godard et al., ICCV 2019), at the
scales and with the weights of each network; for SfMLearner the mean of all sources' colour errors with explainability masks and smoothness.
The paper's depth network has the losses of Monodepth2 here; those of its preset are compared with PyTorch one by one (`losses.py`).

Two things differ from the published trainings, here and in the program: both pairs pass the pose encoder in one batch, so that its batch
norms use statistics of both; and a source that does not see a pixel does not explain it (there, its border-padded warp takes part in the
minimum). `main` prints what each does to the loss. Weight decay leaves out biases and the weights of norms, as the program does.

Needs torch, torchvision and numpy.
"""

import math
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2] / "deepfusion-nn/tests/reference"))
import depth_network  # noqa: E402
import lite_mono  # noqa: E402
import r_msfm  # noqa: E402
from networks import DepthDecoder, Encoder, PoseDecoder, fill, write_safetensors  # noqa: E402
from photometric import ALPHA, photometric  # noqa: E402
from sfmlearner import DispNet  # noqa: E402

N, STEPS = 2, 20
OFFSETS = (-1, 1)
DRIFT = (0.8, -1.5)
NEAR, SMOOTHNESS, EXPLAINABILITY = 0.1, 1e-3, 0.2


# --- the networks --------------------------------------------------------------------------------------------


class TwoFiles(nn.Module):
    """A depth network whose encoder and decoder are in separate files; disparities start with the finest, or the newest."""

    def __init__(self, encoder, decoder, oldest_first=False):
        super().__init__()
        self.encoder, self.depth = fill(encoder), fill(decoder)
        self.oldest_first = oldest_first

    def forward(self, image):
        disparities = self.depth(self.encoder(image))
        return disparities[::-1] if self.oldest_first else disparities


def resnet_depth(layers):
    encoder = Encoder(layers)
    return TwoFiles(encoder, DepthDecoder(encoder.channels))


def lite_mono_depth():
    widths, rates = lite_mono.MODELS["lite-mono"]
    return TwoFiles(lite_mono.Encoder(widths, rates), lite_mono.Decoder(widths))


def r_msfm_depth(iterations):
    return TwoFiles(r_msfm.Encoder(), r_msfm.Decoder(iterations), oldest_first=True)


class Explainability(nn.Module):
    """Computes the logits of a mask for the first and the second frame from the pose encoder's coarsest feature, with the program's
    names."""

    def __init__(self, channels):
        super().__init__()
        widths = (channels, 256, 128, 64, 32, 16)
        self.layers = nn.ModuleList(nn.Conv2d(a, b, 3, padding=1) for a, b in zip(widths, widths[1:]))
        self.head = nn.Conv2d(widths[-1], 2, 3, padding=1)

    def forward(self, x):
        for index, layer in enumerate(self.layers):
            if index > 0:
                x = F.interpolate(x, scale_factor=2, mode="nearest")
            x = F.relu(layer(x))
        return F.interpolate(self.head(x), scale_factor=2, mode="bilinear", align_corners=False)


class PoseNet(nn.Module):
    def __init__(self, layers, explained):
        super().__init__()
        self.encoder = fill(Encoder(layers, frames=2))
        self.pose = fill(PoseDecoder(self.encoder.channels))
        masks = {"explainability": Explainability(self.encoder.channels[4])} if explained else {}
        self.masks = fill(nn.ModuleDict(masks))

    def forward(self, pairs):
        features = self.encoder(pairs)
        logits = [mask(features[4]) for mask in self.masks.values()]
        return 0.01 * self.pose(features)[:, :6], *logits


# --- what each network is trained with -----------------------------------------------------------------------


@dataclass
class Training:
    """A depth network, its losses, the images' size, and the optimiser's settings.

    The learning rates are small: batch norms over a dozen values make steep networks. With these rates the networks still learn, and
    rounding errors stay small. Images are smaller if twenty steps would make the test slow. Weights decay if the preset's do, but faster,
    so that twenty steps show it (a thousandth each). Gradients are clipped at the preset's norm if they exceed it.
    """

    depth: Callable[[], nn.Module]
    # For each disparity: number of halvings, weight, and weight of its smoothness.
    scales: list
    # Names of weights from the beginning to the end of the depth network: the program's and PyTorch's.
    compared: dict
    rate: float
    # Height, width.
    size: tuple = (64, 96)
    pose_layers: int = 18
    # SfMLearner's losses.
    explained: bool = False
    far: float = 100.0
    clip: float = 0.0
    decay: float = 0.0
    pose_compared: dict = field(default_factory=dict)


def halved(count):
    return [(s, 1 / count, 1 / count / 2**s) for s in range(count)]


def refined(count):
    return [(0, 0.9**age, 0.9**age) for age in range(count)]


def of_resnet(last):
    return {
        "encoder.conv1": "encoder.encoder.conv1",
        "encoder.layer2.0.conv1": "encoder.encoder.layer2.0.conv1",
        f"encoder.layer4.{last}": f"encoder.encoder.layer4.{last}",
        "decoder.stages.0.reduce": "depth.decoder.0.conv.conv",
        "decoder.stages.3.fuse": "depth.decoder.7.conv.conv",
        "decoder.heads.0": "depth.decoder.10.conv",
        "decoder.heads.3": "depth.decoder.13.conv",
    }


LITE_MONO = {
    "lite_mono.encoder.stem.0.conv": "encoder.downsample_layers.0.0.conv",
    "lite_mono.encoder.reduce.1": "encoder.downsample_layers.1.0.conv",
    "lite_mono.encoder.stages.0.global.position": "encoder.stages.0.3.pos_embd.token_projection",
    "lite_mono.encoder.stages.1.dilated.2.bottleneck.expand": "encoder.stages.1.2.pwconv1",
    "lite_mono.encoder.stages.2.dilated.6.depthwise": "encoder.stages.2.6.ddwconv.conv",
    "lite_mono.encoder.stages.2.global.attention.qkv": "encoder.stages.2.9.xca.qkv",
    "lite_mono.encoder.stages.2.global.attention_norm": "encoder.stages.2.9.norm_xca",
    "lite_mono.decoder.stages.0.reduce": "depth.decoder.0.conv.conv",
    "lite_mono.decoder.heads.0": "depth.decoder.6.conv",
    "lite_mono.decoder.heads.2": "depth.decoder.8.conv",
}

R_MSFM = {
    "r_msfm.encoder.conv1": "encoder.encoder.conv1",
    "r_msfm.encoder.layer2.1.bn2": "encoder.encoder.layer2.1.bn2",
    "r_msfm.features.coarse": "depth.convX31.1",
    "r_msfm.features.fine": "depth.convX11.4",
    "r_msfm.gru.across.update": "depth.gruc.convz1",
    "r_msfm.gru.down.candidate": "depth.gruc.convq2",
    "r_msfm.update.state_1": "depth.update_block.encoder.convc1.conv.conv",
    "r_msfm.update.change_2": "depth.update_block.flow_head.covd2.1",
    "r_msfm.weights.expand": "depth.update_block.mask.3",
}

DISP_NET = {
    "disp_net.encoder.0.halve": "conv1.0",
    "disp_net.encoder.4.halve": "conv5.0",
    "disp_net.decoder.2.enlarge": "upconv5.0",
    "disp_net.decoder.4.join": "iconv3.0",
    "disp_net.decoder.6.enlarge": "upconv1.0",
    "disp_net.heads.0": "predict_disp1.0",
    "disp_net.heads.3": "predict_disp4.0",
}

# Here the network has the program's names.
PAPER = {
    name: name
    for name in (
        "encoder.conv1",
        "encoder.layer4.1.conv2",
        "hce.0.dilated.1.conv",
        "hce.3.global",
        "attention.0.spatial",
        "attention.3.squeeze",
        "aggregation.project",
        "decoder.stages.0.reduce",
        "decoder.heads.0",
        "decoder.heads.3",
    )
}

POSE = {
    "encoder.conv1": "encoder.encoder.conv1",
    "encoder.layer3.1.conv2": "encoder.encoder.layer3.1.conv2",
    "decoder.squeeze": "pose.net.0",
    "decoder.output": "pose.net.3",
}
MASKS = {f"explainability.{part}": f"masks.explainability.{part}" for part in ("layers.0", "layers.4", "head")}

TRAININGS = {
    "monodepth2": Training(lambda: resnet_depth(18), halved(4), of_resnet("1.bn2"), 5e-7),
    "monodepth2-50": Training(lambda: resnet_depth(50), halved(4), of_resnet("2.bn3"), 5e-8, (64, 64), pose_layers=50),
    "lite-mono": Training(lite_mono_depth, halved(3), LITE_MONO, 5e-7, decay=2000.0),
    "r-msfm3": Training(lambda: r_msfm_depth(3), refined(3), R_MSFM, 5e-7, clip=1.0, decay=2000.0),
    "r-msfm6": Training(lambda: r_msfm_depth(6), refined(6), R_MSFM, 5e-7, (32, 64), clip=1.0, decay=2000.0),
    "sfmlearner": Training(lambda: fill(DispNet()), halved(4), DISP_NET, 2e-6, (64, 64), explained=True, pose_compared=MASKS),
    "paper": Training(
        lambda: fill(depth_network.DepthNet(18, 16, (24, 16, 16, 8, 8))), halved(4), PAPER, 5e-7, far=90.0
    ),
}


# --- the step ------------------------------------------------------------------------------------------------


def picture(offset, size):
    """The frame at an offset in time, N×3×H×W in (0, 1): waves that move roughly as new pose networks predict."""
    n, c, v, u = np.meshgrid(*map(np.arange, (N, 3, *size)), indexing="ij")
    moved = offset * (1 + 0.3 * n)
    x, y = u + DRIFT[0] * moved, v + DRIFT[1] * moved
    waves = 0.5 + 0.22 * np.sin(0.31 * x + 0.17 * y + c + n) + 0.2 * np.cos(0.13 * x - 0.23 * y + 2 * c + 0.7 * n)
    return torch.from_numpy(waves.astype(np.float32))


def camera(height, width):
    return torch.tensor([[0.58 * width, 0, 0.5 * width], [0, 0.87 * height, 0.5 * height], [0, 0, 1]])


def rotation(v):
    theta = (v.square().sum(1) + 1e-12).sqrt()[:, None, None]
    x, y, z = v.unbind(1)
    o = torch.zeros_like(x)
    skew = torch.stack([o, -z, y, z, o, -x, -y, x, o], 1).reshape(-1, 3, 3)
    eye = torch.eye(3, dtype=v.dtype)
    return eye + skew * (theta.sin() / theta) + skew @ skew * ((1 - theta.cos()) / theta**2)


def warp(source, inverse_depth, turn, step, k):
    height, width = source.shape[2:]
    v, u = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    rays = torch.linalg.inv(k.double()).to(k) @ torch.stack([u, v, torch.ones_like(u)]).reshape(3, -1).to(k)
    points = rays[None] / inverse_depth.reshape(N, 1, -1)
    seen = k @ (turn @ points + step[:, :, None])
    assert seen[:, 2].min() > 1e-2, "everything is ahead of every camera"
    u, v = (seen[:, :2] / seen[:, 2:]).reshape(N, 2, height, width).unbind(1)
    grid = torch.stack([2 * u / (width - 1) - 1, 2 * v / (height - 1) - 1], -1)
    inside = ((u >= 0) & (u <= width - 1) & (v >= 0) & (v <= height - 1))[:, None]
    return F.grid_sample(source, grid, "bilinear", "border", align_corners=True), inside


def smoothness(disparity, image):
    d = disparity / (disparity.mean((2, 3), keepdim=True) + 1e-7)

    def along(axis):
        return (d.diff(dim=axis).abs() * (-image.diff(dim=axis).abs().mean(1, keepdim=True)).exp()).mean()

    return along(3) + along(2)


class Networks:
    def __init__(self, training, dtype):
        self.training, self.dtype = training, dtype
        self.depth = training.depth().to(dtype).train()
        self.pose = PoseNet(training.pose_layers, training.explained).to(dtype).train()

    def parameters(self):
        return [*self.depth.parameters(), *self.pose.parameters()]

    def compared(self):
        """The weights whose gradients are written, by the program's names."""
        nets = (("depth", self.depth, self.training.compared), ("pose", self.pose, POSE | self.training.pose_compared))
        return {
            f"{prefix}.{ours}.weight": net.get_parameter(f"{theirs}.weight")
            for prefix, net, names in nets
            for ours, theirs in names.items()
        }

    def motions(self, target, sources, together):
        """The poses used for warping, and, where there are masks, the logits of the target's, N×views×H×W."""
        pairs = [torch.cat([s, target] if o < 0 else [target, s], 1) for o, s in zip(OFFSETS, sources)]
        run = self.pose(torch.cat(pairs)) if together else map(torch.cat, zip(*map(self.pose, pairs)))
        poses, *logits = (output.split(N) for output in run)
        motions = []
        for offset, raw in zip(OFFSETS, poses):
            turn, step = rotation(raw[:, :3]), raw[:, 3:]
            if offset < 0:
                turn = turn.mT
                step = -(turn @ step[:, :, None])[:, :, 0]
            motions.append((turn, step))
        # If the source comes before the target, the target is the second frame.
        logits = [torch.cat([l[:, 1:] if o < 0 else l[:, :1] for o, l in zip(OFFSETS, both)], 1) for both in logits]
        return motions, *logits

    def step(self, together=True, only_seen=True):
        size = self.training.size
        target, *sources = [picture(o, size).to(self.dtype) for o in (0, *OFFSETS)]
        k = camera(*size).to(self.dtype)
        alpha = 0.0 if self.training.explained else ALPHA
        disparities = self.depth(target)
        motions, *logits = self.motions(target, sources, together)
        still = torch.cat([photometric(source, target, alpha) for source in sources], 1).detach()
        terms, explained = [0.0, 0.0], None
        for (halvings, weight, smooth_weight), sigma in zip(self.training.scales, disparities):
            image = target
            for _ in range(halvings):
                image = F.avg_pool2d(image, 2)
            full = F.interpolate(sigma, size, mode="bilinear", align_corners=False)
            far = 1 / self.training.far
            inverse_depth = far + (1 / NEAR - far) * full
            views = [warp(source, inverse_depth, turn, step, k) for source, (turn, step) in zip(sources, motions)]
            errors = torch.cat([photometric(warped, target, alpha) for warped, _ in views], 1)
            seen = torch.cat([inside for _, inside in views], 1)
            if not only_seen:
                seen = torch.ones_like(seen)
            if self.training.explained:
                loss = (logits[0].sigmoid() * torch.where(seen, errors, still)).mean()
                by_warp = (seen & (logits[0] > 0)).any(1)
            else:
                best, which = torch.cat([still, torch.where(seen, errors, torch.inf)], 1).min(1)
                loss, by_warp = best.mean(), which >= len(sources)
            terms[0] = terms[0] + weight * loss
            terms[1] = terms[1] + smooth_weight * smoothness(sigma, image)
            if explained is None:
                explained = by_warp.double().mean()
        total = terms[0] + SMOOTHNESS * terms[1]
        if self.training.explained:
            terms.append(F.softplus(-logits[0]).mean())
            total = total + EXPLAINABILITY * terms[2]
        return total, [total, *terms[:2], explained, *terms[2:]], disparities, motions


def train(networks):
    """The losses of the steps, and the first gradient's norm."""
    training, learned = networks.training, networks.parameters()
    # Lite-Mono's temperatures are one number for each head, whatever their shape.
    is_kernel = lambda p: p.squeeze().dim() > 1  # noqa: E731
    kernels, others = [p for p in learned if is_kernel(p)], [p for p in learned if not is_kernel(p)]
    groups = [{"params": kernels, "weight_decay": training.decay}, {"params": others, "weight_decay": 0.0}]
    adam = torch.optim.AdamW(groups, training.rate)
    losses, norms = [], []
    for _ in range(STEPS):
        loss, *_ = networks.step()
        losses.append(loss.item())
        adam.zero_grad()
        loss.backward()
        norm = nn.utils.clip_grad_norm_(learned, training.clip or math.inf)
        norms.append(norm.item())
        adam.step()
    return np.array(losses), np.array(norms)


def written(name, training):
    tensors = {}

    def keep(name, tensor, every=1):
        tensors[name] = tensor.detach().double().flatten()[::every].float().numpy()

    networks = Networks(training, torch.float64)
    loss, terms, disparities, motions = networks.step()
    loss.backward()
    keep("terms", torch.stack(terms))
    for index, ((halvings, *_), disparity) in enumerate(zip(training.scales, disparities)):
        keep(f"disparity{index}", disparity, 31 if halvings == 0 else 11)
    for view, (turn, step) in enumerate(motions):
        keep(f"rotation{view}", turn)
        keep(f"translation{view}", step)
    in_float32 = []
    for onednn in (True, False):
        with torch.backends.mkldnn.flags(enabled=onednn):
            rounded = Networks(training, torch.float32)
            rounded.step()[0].backward()
        in_float32.append(rounded.compared().values())
    for (name, parameter), *both in zip(networks.compared().items(), *in_float32):
        gradient = parameter.grad
        keep(f"{name}/norm", gradient.norm().reshape(1))
        every = max(1, gradient.numel() // 23) | 1
        keep(f"{name}/gradient", gradient, every)
        size = gradient.abs().clamp(min=gradient.square().mean().sqrt())
        off = torch.stack([(rounded.grad - gradient).abs() / size for rounded in both])
        keep(f"{name}/float32", off.flatten(1)[:, ::every].max().reshape(1))
        print(f"  {name}: float32 off by {tensors[f'{name}/float32'][0]:.1e}")

    exact, norms = train(Networks(training, torch.float64))
    rounded, rounded_norms = train(Networks(training, torch.float32))
    tensors["losses"] = exact.astype(np.float32)
    # The norm of all gradients together.
    tensors["all/norm"] = norms[:1].astype(np.float32)
    tensors["all/float32"] = np.abs(rounded_norms / norms - 1)[:1].astype(np.float32)

    print("  loss, reprojection, smoothness, explained:", tensors["terms"])
    for name, options in {"pairs apart": {"together": False}, "border": {"only_seen": False}}.items():
        other = Networks(training, torch.float64).step(**options)[0].item()
        print(f"  {name}: {other:.6f}, {other / loss.item() - 1:+.2e}")
    for name, (turn, step) in zip(OFFSETS, motions):
        print(f"  {name} step", step.detach().numpy().round(4).tolist())
    print("  disparities", [(round(d.min().item(), 3), round(d.max().item(), 3)) for d in disparities])
    print("  losses", exact, "norms", norms)
    off, change = np.abs(rounded / exact - 1).max(), exact[-1] / exact[0] - 1
    print("  float32 off by", off, "norms", np.abs(rounded_norms / norms - 1).max(), "losses change by", change)
    assert off < 1e-3 / 3 and abs(change) > 0.01
    return tensors


def main():
    (HERE / "whole_step").mkdir(exist_ok=True)
    for name in sys.argv[1:] or TRAININGS:
        print(name, flush=True)
        write_safetensors(HERE / "whole_step" / f"{name}.safetensors", written(name, TRAININGS[name]))


if __name__ == "__main__":
    main()
