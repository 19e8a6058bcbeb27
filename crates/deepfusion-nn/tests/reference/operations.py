#!/usr/bin/env python3
"""Reference values for the operations under the networks, from PyTorch.

    python crates/deepfusion-nn/tests/reference/operations.py

draws random configurations (odd sizes, strides, paddings, dilations) and writes, beside this file:

- `operations.json`: each case's name, operation, options and inputs. An input is (name, shape, scale, offset):
  its values are offset + scale·`uniform`, which the Rust tests compute, too (tests/networks/formula.rs).
- `operations.safetensors`: PyTorch's output and its gradient with respect to every input that has one, for
  the loss Σ output·pattern with a random pattern. Computed in double precision from float32 inputs, so that the
  only difference in a test is the Rust program's rounding. Of long tensors every `stride`-th value is kept.

Needs torch, torchvision (for networks.py) and numpy.
"""

import json
import math
import random

import numpy as np
import torch
import torch.nn.functional as F
from networks import HERE, uniform, write_safetensors

AT_MOST = 400  # values of a tensor that are kept

cases, expected = [], {}


def keep(name, tensor):
    values = tensor.detach().flatten()
    stride = 1 if len(values) <= AT_MOST else (len(values) // AT_MOST) | 1
    expected[name] = values[::stride].float().numpy()


def case(operation, function, inputs, options, constant=()):
    """Adds a case; `constant` names the inputs without a gradient."""
    name = f"{operation}{sum(c['operation'] == operation for c in cases):02}"
    cases.append({"name": name, "operation": operation, "inputs": inputs, "options": options})
    tensors = []
    for key, shape, scale, offset in inputs:
        values = uniform(f"{name}/{key}", math.prod(shape), None)
        values = np.float32(offset) + np.float32(scale) * values
        tensors.append(torch.from_numpy(values.reshape(shape)).double().requires_grad_(key not in constant))
    output = function(*tensors, **options)
    pattern = uniform(f"{name}/pattern", output.numel(), None).reshape(output.shape)
    (output * torch.from_numpy(pattern).double()).sum().backward()
    keep(f"{name}/output", output)
    for (key, *_), tensor in zip(inputs, tensors):
        if tensor.requires_grad:
            keep(f"{name}/{key}", tensor.grad)


# --- the operations in PyTorch -------------------------------------------------------------------------------


def conv2d(x, weight, bias=None, *, stride, padding, dilation, reflect):
    if reflect:
        x, padding = F.pad(x, [padding] * 4, mode="reflect"), 0
    return F.conv2d(x, weight, bias, stride, padding, dilation)


def warp(image, coords):
    """`coords` are in pixels; for grid_sample the centres of the first and last pixel are −1 and 1."""
    last = torch.tensor([image.shape[3] - 1, image.shape[2] - 1]).double()
    grid = coords.permute(0, 2, 3, 1) / last * 2 - 1
    return F.grid_sample(image, grid, padding_mode="border", align_corners=True)


def local_correlation(first, second, *, radius):
    """The windows of the second image around each pixel, unfolded; a window's displacements come row by row."""
    n, channels, height, width = first.shape
    windows = F.unfold(second, 2 * radius + 1, padding=radius)
    windows = windows.reshape(n, channels, (2 * radius + 1) ** 2, height, width)
    return (first[:, :, None] * windows).mean(1)


def photometric(a, b, *, alpha):
    def mean(t):
        return F.avg_pool2d(F.pad(t, (1, 1, 1, 1), mode="reflect"), 3, 1)

    mu_a, mu_b = mean(a), mean(b)
    var_a, var_b, covariance = mean(a * a) - mu_a**2, mean(b * b) - mu_b**2, mean(a * b) - mu_a * mu_b
    ssim = (2 * mu_a * mu_b + 0.01**2) * (2 * covariance + 0.03**2)
    ssim = ssim / ((mu_a**2 + mu_b**2 + 0.01**2) * (var_a + var_b + 0.03**2))
    error = alpha * ((1 - ssim) / 2).clamp(0, 1) + (1 - alpha) * (a - b).abs()
    return error.mean(1, keepdim=True)


def batch_norm(x, gamma, beta, *, relu):
    y = F.batch_norm(x, None, None, gamma, beta, training=True, eps=1e-5)
    return F.relu(y) if relu else y


def upsample_concat(x, skip=None):
    large = F.interpolate(x, scale_factor=2, mode="nearest")
    return large if skip is None else torch.cat([large, skip], 1)


def project(depth, turn, shift):
    """p' ~ H·p̃ + d·s; H is close to the identity."""
    n, _, height, width = depth.shape
    y, x = torch.meshgrid(torch.arange(height).double(), torch.arange(width).double(), indexing="ij")
    pixels = torch.stack([x, y, torch.ones_like(x)]).reshape(1, 3, -1)
    homography = torch.eye(3).double() + turn.reshape(n, 3, 3)
    point = homography @ pixels + shift.reshape(n, 3, 1) * depth.reshape(n, 1, -1)
    return (point[:, :2] / point[:, 2:]).reshape(n, 2, height, width)


def smoothness(disparity, image):
    normalised = disparity / (disparity.mean((2, 3), keepdim=True) + 1e-7)
    total = 0
    for axis in (2, 3):
        edge = image.diff(dim=axis).abs().mean(1, keepdim=True)
        total = total + (normalised.diff(dim=axis).abs() * torch.exp(-edge)).mean()
    return total.reshape(1, 1, 1, 1)


# --- the configurations --------------------------------------------------------------------------------------


def convolutions(rng):
    settings = [(k, s, d) for k in (1, 3, 5, 7) for s in (1, 2, 3) for d in (1, 2, 3)]
    # A 1×1 has no dilation. Ten plain 3×3 with reflection, as in the decoder, make forty.
    settings = [s for s in settings if s[0] > 1 or s[2] == 1] + [(3, 1, 1)] * 10
    for index, (kernel, stride, dilation) in enumerate(settings):
        reach = (kernel - 1) * dilation + 1
        reflect = rng.random() < 0.4 or index >= 30
        while True:
            batch, channels, outputs = rng.randint(1, 3), rng.randint(1, 5), rng.randint(1, 5)
            height, width = rng.randint(4, 21), rng.randint(4, 21)
            padding = rng.randint(int(reflect), reach // 2 + 1)
            fits = min(height, width) + 2 * padding >= reach
            if fits and not (reflect and padding >= min(height, width)):
                break
        inputs = [
            ("x", (batch, channels, height, width), 1.0, 0.0),
            ("weight", (outputs, channels, kernel, kernel), 0.5, 0.0),
        ]
        if rng.random() < 0.5:
            inputs.append(("bias", (outputs,), 1.0, 0.0))
        options = {"stride": stride, "padding": padding, "dilation": dilation, "reflect": reflect}
        case("conv2d", conv2d, inputs, options)


def others(rng):
    def size(least=3):
        return rng.randint(1, 3), rng.randint(1, 5), rng.randint(least, 11), rng.randint(least, 11)

    for _ in range(8):
        (n, c, h, w), (_, _, to_h, to_w) = size(), size()
        # Coordinates inside and outside the view.
        coords = ("coords", (n, 2, to_h, to_w), 0.7 * max(h, w), 0.5 * min(h, w))
        case("warp", warp, [("image", (n, c, h, w), 1.0, 0.0), coords], {})
    for alpha in (0.85, 0.85, 0.85, 1.0, 0.0, 0.5):
        shape = size()
        inputs = [("a", shape, 0.5, 0.5), ("b", shape, 0.5, 0.5)]
        case("photometric", photometric, inputs, {"alpha": alpha}, constant=("b",))
    for relu in (True, True, True, False, False):
        n, c, h, w = size()
        inputs = [("x", (n, c, h, w), 2.0, 0.3), ("gamma", (c,), 0.3, 1.0), ("beta", (c,), 0.5, 0.0)]
        case("batch_norm", batch_norm, inputs, {"relu": relu})
    for _ in range(3):
        case("elu", F.elu, [("x", size(), 3.0, 0.0)], {})
    for skip in (True, True, True, False):
        n, c, h, w = size()
        inputs = [("x", (n, c, h, w), 1.0, 0.0)]
        if skip:
            inputs.append(("skip", (n, rng.randint(1, 5), 2 * h, 2 * w), 1.0, 0.0))
        case("upsample_concat", upsample_concat, inputs, {})
    for _ in range(4):
        n, _, h, w = size()
        # Everything in front of the camera: behind it nothing is differentiable.
        inputs = [("depth", (n, 1, h, w), 0.1, 0.2), ("turn", (n, 9), 0.02, 0.0), ("shift", (n, 3), 1.0, 0.0)]
        case("project", project, inputs, {})
    for _ in range(4):
        n, c, h, w = size()
        inputs = [("disparity", (n, 1, h, w), 0.4, 0.5), ("image", (n, c, h, w), 0.5, 0.5)]
        case("smoothness", smoothness, inputs, {}, constant=("image",))


def correlations(rng):
    # Images smaller than the radius, and wider than a vector.
    for radius in (4, 4, 4, 3, 2, 1, 0):
        shape = rng.randint(1, 3), rng.randint(1, 19), rng.randint(1, 12), rng.randint(1, 40)
        inputs = [("first", shape, 1.0, 0.0), ("second", shape, 1.0, 0.1)]
        case("local_correlation", local_correlation, inputs, {"radius": radius})


def main():
    rng = random.Random(1)
    convolutions(rng)
    others(rng)
    correlations(rng)
    write_safetensors(HERE / "operations.safetensors", expected)
    lines = ",\n".join(json.dumps(c, separators=(",", ":")) for c in cases)
    (HERE / "operations.json").write_text(f"[\n{lines}\n]\n")


if __name__ == "__main__":
    main()
