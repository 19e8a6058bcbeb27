#!/usr/bin/env python3
"""Reference values for the loss terms, from PyTorch.

    python crates/deepfusion-train/tests/reference/losses.py

writes `losses.safetensors` beside this file: the inputs of each term (float32), and its value and the gradient
with respect to every input that has one, computed in double precision from those inputs. Values that are compared with a
limit (in view, led back by the reversed flow, dynamic) are drawn until every pixel is clear of that limit, so that
rounding cannot decide.

Needs torch and numpy.
"""

import sys
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2] / "deepfusion-nn/tests/reference"))
from networks import write_safetensors  # noqa: E402
from photometric import photometric  # noqa: E402

N, H, W = 2, 12, 20
tensors = {}
rng = np.random.default_rng(7)


def keep(name, tensor):
    tensors[name] = tensor.detach().float().numpy()


def given(name, values, grad=True):
    """An input, rounded to float32 before it is used."""
    values = np.asarray(values, dtype=np.float32)
    tensors[name] = values
    return torch.from_numpy(values).double().requires_grad_(grad)


def done(term, loss, **inputs):
    keep(f"{term}/loss", loss.reshape(1))
    for name, tensor in inputs.items():
        tensor.grad = None
    loss.backward(retain_graph=True)
    for name, tensor in inputs.items():
        keep(f"{term}/{name}.grad", tensor.grad)


def picture(phase, shift=0.0, channels=3):
    """Waves with a little noise, moved to the left by `shift` pixels."""
    v, u = np.meshgrid(np.arange(H), np.arange(W) + shift, indexing="ij")
    waves = [0.5 + 0.3 * np.sin(0.9 * u + 0.5 * v + phase + c) * np.cos(0.4 * v - c) for c in range(channels)]
    return np.stack(waves) + rng.uniform(-0.05, 0.05, (channels, H, W))


def grid():
    v, u = torch.meshgrid(torch.arange(H), torch.arange(W), indexing="ij")
    return torch.stack([u, v]).double()[None]


def sample(image, coords):
    u = 2 * coords[:, 0] / (W - 1) - 1
    v = 2 * coords[:, 1] / (H - 1) - 1
    return F.grid_sample(image, torch.stack([u, v], -1), "bilinear", "border", align_corners=True)


def in_view(coords):
    u, v = coords[:, :1], coords[:, 1:]
    return (u >= 0) & (u <= W - 1) & (v >= 0) & (v <= H - 1)


def clear(margin, *distances):
    """Whether everything that is compared with zero is at least `margin` away from it."""
    return all(d.detach().abs().min().item() > margin for d in distances)


def masked_mean(values, mask):
    """The mean over each image, then over the images."""
    mask = mask.expand_as(values)
    return ((values * mask).sum((1, 2, 3)) / mask.sum((1, 2, 3))).mean()


# --- the flow loss (Eq. 16-20) -------------------------------------------------------------------------------


def flow_view(target, source, flow, back):
    coords = grid() + flow
    back_there = sample(back, coords)
    trip = flow + back_there
    square = lambda t: (t.detach() ** 2).sum(1, keepdim=True)  # noqa: E731
    spare = 0.01 * (square(flow) + square(back_there)) + 0.5 - square(trip)
    edges = [coords[:, :1], W - 1 - coords[:, :1], coords[:, 1:], H - 1 - coords[:, 1:]]
    inside = in_view(coords)
    back_again = inside & (spare > 0)
    # If fewer than half of an image's pixels are led back, the flow is wrong, not the pixels occluded.
    wrong = back_again.sum((1, 2, 3), keepdim=True) < 0.5 * inside.sum((1, 2, 3), keepdim=True)
    visible = (back_again | (inside & wrong)).detach()
    error = photometric(sample(source, coords), target)
    return error, coords, trip, visible, [spare, *edges]


def second_order(flow, image):
    total = 0
    for axis in (3, 2):
        bend = flow.diff(n=2, dim=axis).abs()
        step = image.diff(dim=axis).abs().mean(1, keepdim=True)
        n = step.shape[axis]
        edge = torch.maximum(step.narrow(axis, 1, n - 1), step.narrow(axis, 0, n - 1))
        total = total + (bend * torch.exp(-10 * edge)).mean()
    return total


def draw_flow():
    first = np.stack([picture(p) for p in (0.0, 1.0)])
    second = np.stack([picture(p, 1.3) for p in (0.0, 1.0)])
    ahead = np.zeros((N, 2, H, W)) + np.array([-1.3, 0.2]).reshape(1, 2, 1, 1)
    noise = lambda: rng.uniform(-0.6, 0.6, ahead.shape)  # noqa: E731
    return first, second, ahead + noise(), -ahead + noise()


while True:
    a, b, f01, f10 = draw_flow()
    a, b = given("flow/first", a, False), given("flow/second", b, False)
    f01, f10 = given("flow/forward", f01), given("flow/backward", f10)
    there = flow_view(a, b, f01, f10)
    back = flow_view(b, a, f10, f01)
    if clear(2e-3, *there[4], *back[4]):
        break
assert 0.3 < there[3].double().mean() < 0.9
# The images of both directions together, and the two terms.
error, trip, visible = (torch.cat([x, y]) for x, y in zip((there[0], there[2], there[3]), (back[0], back[2], back[3])))
l_photo = 2 * masked_mean(error, visible)
l_consistency = 2 * masked_mean(trip.abs(), visible)  # the L1 norm of two components is twice their mean
l_smooth = (second_order(f01, a) + second_order(f10, b)) / 2
done("flow", l_photo + 0.1 * l_consistency + 0.05 * l_smooth, forward=f01, backward=f10)
keep("flow/error", there[0])
keep("flow/visible", there[3].double())

# --- the affine invariant loss (Eq. 9) -----------------------------------------------------------------------

x = given("affine/x", rng.uniform(4, 40, (N, 1, H, W)))
y = given("affine/y", 1.7 * x.detach().numpy() + 3 + rng.uniform(-4, 4, (N, 1, H, W)), False)
valid = torch.from_numpy(rng.uniform(size=(N, 1, H, W)) > 0.3)
tensors["affine/valid"] = valid.double().float().numpy()
total = 0
for n in range(N):
    xs, ys = x[n][valid[n]], y[n][valid[n]]
    ridge = (0.01 * xs.mean()) ** 2 + 1e-12
    a_ = ((xs - xs.mean()) * (ys - ys.mean())).mean() / (((xs - xs.mean()) ** 2).mean() + ridge)
    b_ = ys.mean() - a_ * xs.mean()
    # The middle one of the sorted values; the upper one of two.
    median = ys.sort().values[len(ys) // 2]
    floor = 0.01 * median + 1e-6
    total = total + ((a_ * xs + b_ - ys).abs().mean() + floor) / ((ys - median).abs().mean() + floor)
done("affine", total / N, x=x)

# --- the other frame's depth seen from this one ---------------------------------------------------------------

K = np.array([[15.0, 0, 9.5], [0, 14.0, 5.5], [0, 0, 1]])
given("seen/intrinsics", np.stack([K] * N), False)
inverse = given("seen/inverse_intrinsics", np.stack([np.linalg.inv(K)] * N), False)
axis_angle = given("seen/axis_angle", rng.uniform(-0.05, 0.05, (N, 3)))
translation = given("seen/translation", rng.uniform(-0.5, 0.5, (N, 3)))
depth = given("seen/depth", rng.uniform(4, 40, (N, 1, H, W)))
coords = given("seen/coords", grid().numpy() + rng.uniform(-2, 2, (N, 2, H, W)))


def rotation(v):
    zero = torch.zeros_like(v[:, 0])
    skew = torch.stack([zero, -v[:, 2], v[:, 1], v[:, 2], zero, -v[:, 0], -v[:, 1], v[:, 0], zero], 1)
    return torch.linalg.matrix_exp(skew.reshape(-1, 3, 3))


rays = inverse @ torch.cat([coords, torch.ones(N, 1, H, W)], 1).reshape(N, 3, -1)
points = rotation(axis_angle) @ (rays * depth.reshape(N, 1, -1)) + translation[:, :, None]
seen = points[:, 2].reshape(N, 1, H, W)
pattern = torch.from_numpy(np.cos(np.arange(N * H * W)).reshape(N, 1, H, W))
done("seen", (seen * pattern).sum(), depth=depth, coords=coords, axis_angle=axis_angle, translation=translation)
keep("seen/seen", seen)

# --- epipolar distance and moving pixels ----------------------------------------------------------------------

R = rotation(axis_angle.detach())
t = translation.detach()
homogeneous = lambda p: torch.cat([p, torch.ones(N, 1, H, W)], 1).reshape(N, 3, -1)  # noqa: E731
here = inverse @ homogeneous(grid().expand(N, -1, -1, -1))
normal = torch.linalg.cross(t[:, :, None].expand_as(here), R @ here, dim=1)  # of the epipolar plane
line = inverse.transpose(1, 2) @ normal
ends = homogeneous(coords.detach())
distance = ((line * ends).sum(1).abs() / (line[:, 0] ** 2 + line[:, 1] ** 2).sqrt()).reshape(N, 1, H, W)
keep("moving/distance", distance)

while True:
    flow_error = given("moving/flow_error", rng.uniform(0, 0.3, (N, 1, H, W)), False)
    rigid_error = given("moving/rigid_error", rng.uniform(0, 0.5, (N, 1, H, W)), False)
    rigid_ends = given("moving/rigid_coords", coords.detach().numpy() + rng.uniform(-3, 3, (N, 2, H, W)), False)
    better = rigid_error - flow_error - 0.02
    length = lambda d: (d**2).sum(1, keepdim=True).sqrt()  # noqa: E731
    apart = length(rigid_ends - coords.detach())
    longest = torch.maximum(length(coords.detach() - grid()), length(rigid_ends - grid()))
    limit = torch.clamp(0.4 * longest, min=1.0)
    far = torch.from_numpy(K) @ R @ here
    far = (far[:, :2] / far[:, 2:]).reshape(N, 2, H, W)
    flow_parallax, rigid_parallax = length(coords.detach() - far), length(rigid_ends - far)
    longer, shorter = flow_parallax - 2 * rigid_parallax, rigid_parallax - 2 * flow_parallax
    if clear(1e-4, better, apart - limit, distance - 0.5, longer, shorter):
        break
moving = (better > 0) & (apart > limit) & (distance > 0.5)
assert 0.1 < moving.double().mean() < 0.6
keep("moving/moving", moving.double())
along = (longer > 0) | (shorter > 0)
keep("moving/along", ((better > 0) & (apart > limit) & along).double())
keep("moving/either", ((better > 0) & (apart > limit) & (along | (distance > 0.5))).double())
any_distance = (better > 0) & (apart > limit)
keep("moving/neither", any_distance.double())

# --- agreement -------------------------------------------------------------------------------------------------

rigid = given("agreement/rigid", rng.uniform(0, 10, (N, 2, H, W)))
flow = given("agreement/flow", rng.uniform(0, 10, (N, 2, H, W)))
both = valid.expand(N, 2, H, W)
distance = (rigid - flow).abs().sum(1, keepdim=True)
done("agreement", masked_mean(distance, valid), rigid=rigid, flow=flow)

write_safetensors(HERE / "losses.safetensors", tensors)
print(f"{len(tensors)} tensors")
