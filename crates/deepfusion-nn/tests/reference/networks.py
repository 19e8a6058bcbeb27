#!/usr/bin/env python3
"""Reference values for the networks, from PyTorch and torchvision.

    python crates/deepfusion-nn/tests/reference/networks.py

writes, beside this file:

- `manifest.json`: names, shapes and types of the tensors in published files: torchvision's
  ResNets and Monodepth2's encoder.pth, depth.pth, pose_encoder.pth, pose.pth. The ResNets are torchvision's
  own; the two decoders are rebuilt here from their published layout.
- `*.pth.gz.gz`: such files from torch.save, at full size, with the weights of `formula`. Their weights repeat
  every 101 values, so that gzip, applied twice, reduces 45 megabytes to 50 kilobytes.
- `expected.safetensors`: outputs, running statistics and gradients, subsampled. They are computed in double
  precision from the float32 weights, so that the only difference in a test is the Rust program's rounding.

Needs torch, torchvision, numpy. The Rust tests compute the same `formula` (tests/networks/formula.rs).
"""

import gzip
import io
import json
import math
import struct
from collections import OrderedDict
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
import torchvision
from torch import nn

HERE = Path(__file__).parent
PERIOD = 101  # of the weights in .pth files; prime, so that no two neighbouring kernels are the same
SIZE = (64, 96)  # height, width
BATCH = 2


# --- the formula ---------------------------------------------------------------------------------------------


def uniform(name, count, period):
    """`count` float32 values in [-1, 1) from a 32-bit hash of the name and the index.

    With a period they repeat, and their mean is removed: in a kernel with a large mean, a constant would dominate
    the image.
    """
    seed = 0x811C9DC5
    for byte in name.encode():
        seed = ((seed ^ byte) * 0x01000193) & 0xFFFFFFFF
    index = np.arange(count, dtype=np.uint64)
    if period:
        index %= period
    x = (seed + index * 0x9E3779B9) & 0xFFFFFFFF
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        x ^= x >> np.uint64(shift)
        x = (x * factor) & 0xFFFFFFFF
    x ^= x >> np.uint64(16)
    x >>= np.uint64(8)
    if period and count > period:
        mean = float(x[:period].sum()) / period
        return ((x.astype(np.float64) - mean) * 2.0**-23).astype(np.float32)
    return x.astype(np.float32) * np.float32(2.0**-23) - np.float32(1.0)


def formula(name, shape, period):
    """Weights that keep activations near one: He-scaled kernels, batch norms near the identity."""
    f = np.float32
    v = uniform(name, math.prod(shape), period)
    if name.endswith("running_var"):
        v = f(1.0) + f(0.3) * v
    elif len(shape) == 1 and name.endswith("weight"):
        # The last batch norm of a residual branch is smaller; otherwise the sum would grow with every block.
        base = 0.4 if ".bn2." in name or ".bn3." in name else 1.0
        v = f(base) + f(0.2) * v
    elif len(shape) == 1:
        v = f(0.1) * v
    else:
        # Disparity heads (one channel) are smaller: a saturated sigmoid hides what happens before it.
        gain = 0.2 if shape[0] == 1 else 1.0
        v = f(gain * math.sqrt(6.0 / math.prod(shape[1:]))) * v
    return torch.from_numpy(v.reshape(shape))


def fill(module, period=None):
    state = module.state_dict()
    for name, tensor in state.items():
        if tensor.dtype.is_floating_point:
            state[name] = formula(name, tuple(tensor.shape), period)
    module.load_state_dict(state)
    return module


def images(name, channels):
    u = uniform(name, BATCH * channels * SIZE[0] * SIZE[1], None)
    u = u * np.float32(0.5) + np.float32(0.5)
    return torch.from_numpy(u.reshape(BATCH, channels, *SIZE)).double()


# --- the networks --------------------------------------------------------------------------------------------


class Encoder(nn.Module):
    """torchvision's ResNet under `encoder`, on `frames` stacked images."""

    def __init__(self, depth, frames=1):
        super().__init__()
        self.encoder = getattr(torchvision.models, f"resnet{depth}")(weights=None)
        if frames > 1:
            self.encoder.conv1 = nn.Conv2d(3 * frames, 64, 7, 2, 3, bias=False)
        self.channels = [64] + [c * (4 if depth > 34 else 1) for c in (64, 128, 256, 512)]

    def forward(self, x):
        return features(self.encoder, (x - 0.45) / 0.225)


def features(resnet, x):
    f0 = F.relu(resnet.bn1(resnet.conv1(x)))
    f1 = resnet.layer1(resnet.maxpool(f0))
    f2 = resnet.layer2(f1)
    f3 = resnet.layer3(f2)
    return [f0, f1, f2, f3, resnet.layer4(f3)]


class Reflected(nn.Module):
    """3×3, reflection-padded; its convolution is called `conv` as in the published files."""

    def __init__(self, inputs, outputs):
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, 3)

    def forward(self, x):
        return self.conv(F.pad(x, (1, 1, 1, 1), mode="reflect"))


class Block(nn.Module):
    def __init__(self, inputs, outputs):
        super().__init__()
        self.conv = Reflected(inputs, outputs)

    def forward(self, x):
        return F.elu(self.conv(x))


class DepthDecoder(nn.Module):
    WIDTHS = (256, 128, 64, 32, 16)

    def __init__(self, channels):
        super().__init__()
        parts, inputs = [], channels[4]
        for stage, width in enumerate(self.WIDTHS):
            skip = channels[3 - stage] if stage < 4 else 0
            parts += [Block(inputs, width), Block(width + skip, width)]
            inputs = width
        parts += [Reflected(self.WIDTHS[4 - scale], 1) for scale in range(4)]
        self.decoder = nn.ModuleList(parts)

    def forward(self, feats):
        x, disparities = feats[4], {}
        for stage in range(5):
            x = F.interpolate(self.decoder[2 * stage](x), scale_factor=2, mode="nearest")
            if stage < 4:
                x = torch.cat([x, feats[3 - stage]], 1)
            x = self.decoder[2 * stage + 1](x)
            scale = 4 - stage
            if scale < 4:
                disparities[scale] = torch.sigmoid(self.decoder[10 + scale](x))
        return [disparities[scale] for scale in range(4)]


class PoseDecoder(nn.Module):
    def __init__(self, channels, poses=2):
        super().__init__()
        self.net = nn.ModuleList(
            [
                nn.Conv2d(channels[4], 256, 1),
                nn.Conv2d(256, 256, 3, padding=1),
                nn.Conv2d(256, 256, 3, padding=1),
                nn.Conv2d(256, 6 * poses, 1),
            ]
        )

    def forward(self, feats):
        x = feats[4]
        for conv in self.net[:3]:
            x = F.relu(conv(x))
        return self.net[3](x).mean((2, 3))


# --- what is written -----------------------------------------------------------------------------------------

expected = OrderedDict()
manifest = {}


def keep(name, tensor, step):
    """Every `step`-th value; steps are prime so that they walk through all rows and channels."""
    expected[name] = tensor.detach().double().flatten()[::step].float().numpy()


def listed(name, module):
    manifest[name] = [
        [key, list(value.shape), "f32" if value.dtype.is_floating_point else "i64"]
        for key, value in module.state_dict().items()
    ]


def save_pth(name, module, extra=None, **options):
    state = module.state_dict()
    state.update(extra or {})
    plain = io.BytesIO()
    torch.save(state, plain, **options)
    # No time in the headers, so that every run writes the same bytes. Compressed twice: deflate's longest match is 258 bytes, and the codes
    # of such matches repeat, too.
    packed = gzip.compress(gzip.compress(plain.getvalue(), mtime=0), mtime=0)
    (HERE / f"{name}.pth.gz.gz").write_bytes(packed)


def monodepth2(depth):
    period = PERIOD if depth == 18 else None
    encoder = fill(Encoder(depth), period).eval()
    decoder = fill(DepthDecoder(encoder.channels), period).eval()
    listed(f"monodepth2_{depth}/encoder", encoder)
    listed(f"monodepth2_{depth}/depth", decoder)
    if depth == 18:
        save_pth("encoder", encoder, {"height": 192, "width": 640, "use_stereo": False})
        save_pth("depth", decoder)
    encoder.double(), decoder.double()
    for scale, disparity in enumerate(decoder(encoder(images("images", 3)))):
        keep(f"monodepth2_{depth}/disparity{scale}", disparity, 31 if scale == 0 else 11)


def pose():
    encoder = fill(Encoder(18, frames=2), PERIOD).eval()
    decoder = fill(PoseDecoder(encoder.channels), PERIOD).eval()
    listed("pose_18/encoder", encoder)
    listed("pose_18/pose", decoder)
    save_pth("pose_encoder", encoder)
    save_pth("pose", decoder)
    encoder.double(), decoder.double()
    keep("pose_18/raw", decoder(encoder(images("pair", 6))), 1)


def imagenet(depth, frames, **options):
    net = fill(getattr(torchvision.models, f"resnet{depth}")(weights=None), PERIOD if depth == 18 else None).eval()
    listed(f"resnet{depth}", net)
    if depth == 18:
        save_pth("resnet18", net, **options)
    if frames > 1:
        conv1 = nn.Conv2d(3 * frames, 64, 7, 2, 3, bias=False)
        conv1.weight.data = net.conv1.weight.data.repeat(1, frames, 1, 1) / frames
        net.conv1 = conv1
    net.double()
    mean = torch.tensor([0.485, 0.456, 0.406]).double().repeat(frames)[None, :, None, None]
    std = torch.tensor([0.229, 0.224, 0.225]).double().repeat(frames)[None, :, None, None]
    x = images("pair" if frames == 2 else "images", 3 * frames)
    for level, feature in enumerate(features(net, (x - mean) / std)):
        keep(f"resnet{depth}/feature{level}", feature, [997, 499, 251, 127, 61][level])


def training():
    """One training step's forward and backward pass: loss = Σ_s mean(σ_s · pattern_s)."""
    encoder = fill(Encoder(18)).double().train()
    decoder = fill(DepthDecoder(encoder.channels)).double().train()
    loss = 0.0
    for scale, disparity in enumerate(decoder(encoder(images("images", 3)))):
        pattern = uniform(f"pattern{scale}", disparity.numel(), None).reshape(disparity.shape)
        loss = loss + (disparity * torch.from_numpy(pattern).double()).mean()
    loss.backward()
    keep("training/loss", loss.reshape(1), 1)
    for part, module in (("encoder", encoder), ("depth", decoder)):
        for name, parameter in module.named_parameters():
            if parameter.grad is not None:
                keep(f"training/{part}/{name}/norm", parameter.grad.norm().reshape(1), 1)
                step = max(1, parameter.numel() // 23) | 1
                keep(f"training/{part}/{name}/gradient", parameter.grad, step)
    for name, buffer in encoder.named_buffers():
        if "running" in name:
            keep(f"training/encoder/{name}", buffer, 7)


def write_safetensors(path, tensors):
    header, offset = {}, 0
    for name, array in tensors.items():
        header[name] = {
            "dtype": "F32",
            "shape": list(array.shape),
            "data_offsets": [offset, offset + array.nbytes],
        }
        offset += array.nbytes
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text)
        for array in tensors.values():
            file.write(array.astype("<f4").tobytes())


def main():
    torch.manual_seed(0)
    monodepth2(18)
    monodepth2(50)
    pose()
    imagenet(18, 1, _use_new_zipfile_serialization=False)
    imagenet(50, 2)
    training()
    write_safetensors(HERE / "expected.safetensors", expected)
    with open(HERE / "manifest.json", "w") as file:
        json.dump(manifest, file, separators=(",", ":"))
        file.write("\n")
    for name, array in expected.items():
        if "training" not in name:
            print(f"{name}: {array.size} values, mean {array.mean():.4f}, std {array.std():.4f}")


if __name__ == "__main__":
    main()
