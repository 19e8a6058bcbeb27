#!/usr/bin/env python3
"""Reference values for Lite-Mono, from PyTorch.

    python crates/deepfusion-nn/tests/reference/lite_mono.py

The networks are rebuilt here from the paper (Zhang et al., "Lite-Mono: A Lightweight CNN and Transformer Architecture for
Self-Supervised Monocular Depth Estimation", CVPR 2023, arXiv 2211.13202), its figures and tables, and from the names and shapes of
the tensors in the published encoder.pth and depth.pth; none of the authors' code is in it. It writes, beside this file:

- `lite_mono.json`: names, shapes and types of the tensors in these files, for the four published networks;
- `lite_mono_encoder.pth.gz.gz`, `lite_mono_depth.pth.gz.gz`: these files for Lite-Mono-tiny from torch.save, with a profiler's counters
  as in the published ones, and the weights of `formula`, which repeat (see networks.py);
- `lite_mono.safetensors`: disparities, and a training step's gradients and running statistics, subsampled, computed in double
  precision from the float32 weights.

Needs torch and numpy. The Rust tests compute the same `formula` (tests/networks/formula.rs).
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
from torch import nn

HERE = Path(__file__).parent
PERIOD = 101
SIZE = (64, 96)  # height, width
BATCH = 2
HEADS, EXPANSION, HALF_CODE = 8, 6, 32

LONG, SHORT = (1, 2, 3, 1, 2, 3, 2, 4, 6), (1, 2, 3, 2, 4, 6)
MODELS = {
    "lite-mono": ((48, 80, 128), LONG),
    "lite-mono-small": ((48, 80, 128), SHORT),
    "lite-mono-tiny": ((32, 64, 128), SHORT),
    "lite-mono-8m": ((64, 128, 224), LONG),
}


# --- the formula, as in networks.py ---------------------------------------------------------------------------


def uniform(name, count, period):
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
    f = np.float32
    v = uniform(name, math.prod(shape), period)
    if name.endswith("running_var"):
        v = f(1.0) + f(0.3) * v
    elif len(shape) == 1 and name.endswith("weight"):
        base = 0.4 if ".bn2." in name or ".bn3." in name else 1.0
        v = f(base) + f(0.2) * v
    elif len(shape) == 1:
        v = f(0.1) * v
    else:
        gain = 0.2 if shape[0] == 1 else 1.0
        v = f(gain * math.sqrt(6.0 / math.prod(shape[1:]))) * v
    return torch.from_numpy(v.reshape(shape))


def fill(module, period):
    state = module.state_dict()
    for name, tensor in state.items():
        if tensor.dtype.is_floating_point:
            state[name] = formula(name, tuple(tensor.shape), period)
    module.load_state_dict(state)
    return module.double()


# --- the networks ---------------------------------------------------------------------------------------------


def named(**parts):
    """Modules under the names that their tensors have in the published files."""
    group = nn.Module()
    for name, part in parts.items():
        if isinstance(part, torch.Tensor):
            group.register_parameter(name, nn.Parameter(part))
        else:
            group.add_module(name, part)
    return group


def on_pixels(layer, x):
    """A layer over the last axis, on each pixel's channels."""
    return layer(x.movedim(1, -1)).movedim(-1, 1)


def widening(width):
    return {"pwconv1": nn.Linear(width, EXPANSION * width), "pwconv2": nn.Linear(EXPANSION * width, width)}


def bottleneck(block, x):
    inner = F.gelu(on_pixels(block.pwconv1, x))
    return on_pixels(block.pwconv2, inner) * block.gamma.view(-1, 1, 1)


def dilated(width, rate):
    conv = nn.Conv2d(width, width, 3, padding=rate, dilation=rate, groups=width, bias=False)
    # The layer norm is in the files, but no computation uses it.
    return named(
        gamma=torch.zeros(width),
        ddwconv=named(conv=conv),
        bn1=nn.BatchNorm2d(width),
        norm=nn.LayerNorm(width, eps=1e-6),
        **widening(width),
    )


def run_dilated(block, x):
    return x + bottleneck(block, block.bn1(block.ddwconv.conv(x)))


def attending(width, placed):
    parts = {
        "gamma_xca": torch.zeros(width),
        "gamma": torch.zeros(width),
        "norm_xca": nn.LayerNorm(width, eps=1e-6),
        "xca": named(
            temperature=torch.ones(HEADS, 1, 1), qkv=nn.Linear(width, 3 * width), proj=nn.Linear(width, width)
        ),
        "norm": nn.LayerNorm(width, eps=1e-6),
        **widening(width),
    }
    if placed:
        parts["pos_embd"] = named(token_projection=nn.Conv2d(2 * HALF_CODE, width, 1))
    return named(**parts)


def positions(height, width):
    """Rows, then columns: sines and cosines of 2π·(i + 1)/n over wavelengths from 1 to 10,000."""
    scale = 10000.0 ** (torch.arange(0, HALF_CODE, 2).double() / HALF_CODE)

    def along(count):
        place = 2 * math.pi * torch.arange(1, count + 1).double() / (count + 1e-6)
        angle = place / scale[:, None]
        return torch.stack([angle.sin(), angle.cos()], 1).reshape(HALF_CODE, count)

    rows = along(height)[:, :, None].expand(-1, -1, width)
    columns = along(width)[:, None, :].expand(-1, height, -1)
    return torch.cat([rows, columns])[None]


def cross_covariance(xca, x):
    batch, width, height, breadth = x.shape
    q, k, v = on_pixels(xca.qkv, x).reshape(batch, 3, HEADS, width // HEADS, -1).unbind(1)
    similar = torch.einsum("bhin,bhjn->bhij", F.normalize(q, dim=-1), F.normalize(k, dim=-1))
    mixed = torch.softmax(similar * xca.temperature, -1) @ v
    return on_pixels(xca.proj, mixed.reshape(batch, width, height, breadth))


def run_attending(block, x):
    z = x
    if hasattr(block, "pos_embd"):
        z = z + block.pos_embd.token_projection(positions(*x.shape[2:]).to(x))
    seen = cross_covariance(block.xca, on_pixels(block.norm_xca, z))
    z = z + seen * block.gamma_xca.view(-1, 1, 1)
    return x + bottleneck(block, on_pixels(block.norm, z))


class Encoder(nn.Module):
    def __init__(self, widths, rates):
        super().__init__()
        first = widths[0]
        stem = [
            named(
                conv=nn.Conv2d(inputs, first, 3, stride, 1, bias=False), bn_gelu=named(bn=nn.BatchNorm2d(first))
            )
            for inputs, stride in ((3, 2), (first, 1), (first, 1))
        ]
        halving = [
            nn.ModuleList([named(conv=nn.Conv2d(inputs, outputs, 3, 2, 1, bias=False))])
            for inputs, outputs in zip((first + 3, 2 * widths[0] + 3, 2 * widths[1] + 3), widths)
        ]
        self.downsample_layers = nn.ModuleList([nn.ModuleList(stem), *halving[1:]])
        self.stem2 = halving[0]
        self.stages = nn.ModuleList(
            nn.ModuleList([*(dilated(width, rate) for rate in row), attending(width, level == 0)])
            for level, (width, row) in enumerate(zip(widths, ((1, 2, 3), (1, 2, 3), rates)))
        )

    def forward(self, images):
        image = x = (images - 0.45) / 0.225
        for layer in self.downsample_layers[0]:
            x = F.gelu(layer.bn_gelu.bn(layer.conv(x)))
        read, features = [x], []
        for halving, stage in zip((self.stem2, *self.downsample_layers[1:]), self.stages):
            image = F.avg_pool2d(image, 3, 2, 1)
            x = start = halving[0].conv(torch.cat([*read, image], 1))
            for block in stage[:-1]:
                x = run_dilated(block, x)
            x = run_attending(stage[-1], x)
            features.append(x)
            read = [start, x]
        return features


def reflected(inputs, outputs):
    return named(conv=nn.Conv2d(inputs, outputs, 3, padding=1, padding_mode="reflect"))


class Decoder(nn.Module):
    def __init__(self, widths):
        super().__init__()
        half = [width // 2 for width in widths]
        reads = ((widths[2], half[2]), (half[2] + widths[1], half[2])), ((half[2], half[1]), (half[1] + widths[0], half[1]))
        reads += (((half[1], half[0]), (half[0], half[0])),)
        blocks = [named(conv=reflected(*sizes)) for stage in reads for sizes in stage]
        self.decoder = nn.ModuleList([*blocks, *(reflected(width, 1) for width in half)])

    def forward(self, features):
        x, disparities = features[2], []
        for stage, skip in enumerate((features[1], features[0], None)):
            x = F.elu(self.decoder[2 * stage].conv.conv(x))
            x = F.interpolate(x, scale_factor=2, mode="bilinear", align_corners=False)
            if skip is not None:
                x = torch.cat([x, skip], 1)
            x = F.elu(self.decoder[2 * stage + 1].conv.conv(x))
            head = F.interpolate(self.decoder[8 - stage].conv(x), scale_factor=2, mode="bilinear", align_corners=False)
            disparities.insert(0, torch.sigmoid(head))
        return disparities


def build(model, period=None):
    widths, rates = MODELS[model]
    return fill(Encoder(widths, rates), period), fill(Decoder(widths), period)


# --- what is written ------------------------------------------------------------------------------------------

expected = OrderedDict()


def keep(name, tensor, step):
    expected[name] = tensor.detach().double().flatten()[::step].float().numpy()


def images():
    u = uniform("images", BATCH * 3 * SIZE[0] * SIZE[1], None) * np.float32(0.5) + np.float32(0.5)
    return torch.from_numpy(u.reshape(BATCH, 3, *SIZE)).double()


def listed(module):
    return [
        [key, list(value.shape), "f32" if value.dtype.is_floating_point else "i64"]
        for key, value in module.state_dict().items()
    ]


def disparities(model, period, name):
    encoder, decoder = (part.eval() for part in build(model, period))
    for scale, disparity in enumerate(decoder(encoder(images()))):
        keep(f"{name}/disparity{scale}", disparity, 31 if scale == 0 else 11)
    return encoder, decoder


def save_pth(name, module, extra):
    """As the published file: tensors, thop's counters in double precision, and the size."""
    state = OrderedDict()
    for prefix in ("", *(part + "." for part, _ in module.named_children())):
        state[f"{prefix}total_ops"] = torch.tensor([0.0], dtype=torch.float64)
        state[f"{prefix}total_params"] = torch.tensor([0.0], dtype=torch.float64)
    for key, value in module.float().state_dict().items():
        state[key] = value
    state.update(extra)
    plain = io.BytesIO()
    torch.save(state, plain)
    packed = gzip.compress(gzip.compress(plain.getvalue(), mtime=0), mtime=0)
    (HERE / f"{name}.pth.gz.gz").write_bytes(packed)


def training():
    """One training step's forward and backward pass: loss = Σ_s mean(σ_s · pattern_s)."""
    encoder, decoder = (part.train() for part in build("lite-mono-tiny"))
    loss = 0.0
    for scale, disparity in enumerate(decoder(encoder(images()))):
        pattern = uniform(f"pattern{scale}", disparity.numel(), None).reshape(disparity.shape)
        loss = loss + (disparity * torch.from_numpy(pattern).double()).mean()
    loss.backward()
    keep("training/loss", loss.reshape(1), 1)
    for part, module in (("encoder", encoder), ("depth", decoder)):
        for name, parameter in module.named_parameters():
            if parameter.grad is not None:
                keep(f"training/{part}/{name}/norm", parameter.grad.norm().reshape(1), 1)
                keep(f"training/{part}/{name}/gradient", parameter.grad, max(1, parameter.numel() // 11) | 1)
    for name, buffer in encoder.named_buffers():
        if "running" in name:
            keep(f"training/encoder/{name}", buffer, 17)


def write_safetensors(path, tensors):
    header, offset = {}, 0
    for name, array in tensors.items():
        header[name] = {"dtype": "F32", "shape": list(array.shape), "data_offsets": [offset, offset + array.nbytes]}
        offset += array.nbytes
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text)
        for array in tensors.values():
            file.write(array.astype("<f4").tobytes())


def main():
    manifest = {}
    for model in MODELS:
        encoder, decoder = disparities(model, None, model)
        manifest[f"{model}/encoder"], manifest[f"{model}/depth"] = listed(encoder), listed(decoder)
        used = [
            value.numel()
            for part in (encoder, decoder)
            for name, value in part.named_parameters()
        ]
        print(f"{model}: {sum(used)} parameters")
    encoder, decoder = disparities("lite-mono-tiny", PERIOD, "pth")
    save_pth("lite_mono_encoder", encoder, {"height": 192, "width": 640, "use_stereo": False})
    save_pth("lite_mono_depth", decoder, {})
    training()
    write_safetensors(HERE / "lite_mono.safetensors", expected)
    with open(HERE / "lite_mono.json", "w") as file:
        json.dump(manifest, file, separators=(",", ":"))
        file.write("\n")
    for name, array in expected.items():
        if "training" not in name:
            print(f"{name}: {array.size} values, mean {array.mean():.4f}, std {array.std():.4f}")


if __name__ == "__main__":
    main()
