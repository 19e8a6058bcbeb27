#!/usr/bin/env python3
"""Reference values for the losses on known depth, from PyTorch: for depth and for its uncertainty.

    python crates/deepfusion-train/tests/reference/depth.py

writes `depth.safetensors` beside this file: the inputs (float32), and the loss, its parts and the gradient with respect to
the disparity of every scale, computed in double precision from those inputs. Errors are drawn until each of them,
and each difference between neighbours, is clear of 0, so that rounding cannot decide the sign of a gradient.

`uncertainty/` has the scale ln b of the error at the finest scale, the negative log-likelihood of the known pixels by PyTorch's own
Laplace distribution, without its constant ln 2, and the gradient with respect to ln b. Some scales are beyond the limits, where
there is no gradient.

Needs torch, torchvision and numpy.
"""

import sys
from pathlib import Path

import numpy as np
import torch

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2] / "deepfusion-nn/tests/reference"))
from networks import write_safetensors  # noqa: E402

N, H, W = 2, 12, 20
STEPS = (1, 2, 4)
GRADIENT_WEIGHT = 0.5
FARTHEST = 80.0
# deepfusion_model::LOG_SCALE_BOUNDS
LOG_SCALE = (-6.0, 2.0)
rng = np.random.default_rng(11)


def drawn():
    """Truth and predictions: near, far, unknown and sky in blocks, so that all kinds of neighbours occur."""
    depth = rng.uniform(2.0, 60.0, (N, 1, H, W))
    kind = rng.choice(3, (N, 1, H // 3, W // 4), p=(0.6, 0.2, 0.2)).repeat(3, 2).repeat(4, 3)
    known, far = kind == 0, kind == 1
    log_depth = np.where(far, np.log(FARTHEST), np.log(depth))
    predictions = [np.exp(-log_depth + rng.normal(0, 0.4, log_depth.shape)) for _ in range(4)]
    return [np.asarray(a, dtype=np.float32) for a in (log_depth, known, far, *predictions)]


def errors(inverse, log_depth, known, far):
    e = -torch.log(inverse) - log_depth
    return torch.where(known, e, torch.where(far, torch.clamp(e, max=0), torch.zeros_like(e)))


def mean_of(values, where):
    """The mean over each image, then over the images."""
    return torch.stack([v[w].mean() for v, w in zip(values, where)]).mean()


def loss(predictions, log_depth, known, far):
    valid = known | far
    e = errors(predictions[0], log_depth, known, far)
    error, gradient = mean_of(e.abs(), valid), 0
    for k in STEPS:
        for a, b, both in (
            (e[..., k:], e[..., :-k], valid[..., k:] & valid[..., :-k]),
            (e[..., k:, :], e[..., :-k, :], valid[..., k:, :] & valid[..., :-k, :]),
        ):
            gradient = gradient + mean_of((a - b).abs(), both)
    total = error + GRADIENT_WEIGHT * gradient
    for scale, inverse in enumerate(predictions[1:], 1):
        total = total + mean_of(errors(inverse, log_depth, known, far).abs(), valid) / (4 * scale)
    return total, error, gradient, e[known].mean()


def clear(predictions, log_depth, known, far):
    """Whether all values are away from kinks."""
    raw = [-torch.log(p) - log_depth for p in predictions]
    e = errors(predictions[0], log_depth, known, far)
    apart = [r[known | far].abs().min() for r in raw]
    for k in STEPS:
        for d, a, b in (
            (e[..., k:] - e[..., :-k], known[..., k:], known[..., :-k]),
            (e[..., k:, :] - e[..., :-k, :], known[..., k:, :], known[..., :-k, :]),
        ):
            apart.append(d[a | b].abs().min())
    return min(apart) > 1e-5


while True:
    arrays = drawn()
    log_depth = torch.from_numpy(arrays[0]).double()
    known, far = (torch.from_numpy(a) > 0.5 for a in arrays[1:3])
    predictions = [torch.from_numpy(a).double().requires_grad_() for a in arrays[3:]]
    with torch.no_grad():
        if clear(predictions, log_depth, known, far):
            break

total, error, gradient, bias = loss(predictions, log_depth, known, far)
total.backward()
names = ["log_depth", "known", "far", *(f"inverse{s}" for s in range(4))]
tensors = {f"depth/{name}": array for name, array in zip(names, arrays)}
for name, value in (("loss", total), ("error", error), ("gradient", gradient), ("bias", bias)):
    tensors[f"depth/{name}"] = value.detach().float().reshape(1).numpy()
for scale, prediction in enumerate(predictions):
    tensors[f"depth/inverse{scale}.grad"] = prediction.grad.float().numpy()

log_scale = rng.normal(-1.5, 1.0, (N, 1, H, W))
beyond = rng.choice(10, log_scale.shape)
log_scale[beyond == 0], log_scale[beyond == 1] = LOG_SCALE[0] - 0.5, LOG_SCALE[1] + 0.5
log_scale = log_scale.astype(np.float32)
assert np.abs(log_scale[..., None] - LOG_SCALE).min() > 1e-3
scale = torch.from_numpy(log_scale).double().requires_grad_()
b = torch.exp(scale.clamp(*LOG_SCALE))
e = -torch.log(predictions[0].detach()) - log_depth
nll = mean_of(-torch.distributions.Laplace(0.0, b).log_prob(e) - np.log(2), known)
nll.backward()
tensors["uncertainty/log_scale"] = log_scale
tensors["uncertainty/loss"] = nll.detach().float().reshape(1).numpy()
tensors["uncertainty/log_scale.grad"] = scale.grad.float().numpy()
write_safetensors(HERE / "depth.safetensors", tensors)
print(f"{len(tensors)} tensors, loss {total.item():.4f}")
