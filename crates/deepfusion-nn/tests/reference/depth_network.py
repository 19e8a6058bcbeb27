#!/usr/bin/env python3
"""Reference values for the paper's depth network and its parts, from PyTorch.

    python crates/deepfusion-nn/tests/reference/depth_network.py

writes `depth_network.safetensors` beside this file: outputs, and gradients of the inputs and of every weight, for the
loss Σ output·pattern with a random pattern. Computed in double precision from float32 weights and inputs, so that the
only difference in a test is the Rust program's rounding. Of long tensors every `stride`-th value is kept.

The modules have the Rust program's names, and so have the entries of a state dictionary. Their weights are the `formula`
of networks.py, which the Rust tests compute, too (tests/networks/formula.rs).

Needs torch, torchvision and numpy. `DepthNet` is also what benches/peers/torch_paper_step.py trains.
"""

from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
import torchvision
from torch import nn

AT_MOST = 60  # values of a tensor that are kept


# --- the network ---------------------------------------------------------------------------------------------


class Block(nn.Module):
    """torchvision's residual block, with a dilation that torchvision's basic block does not support."""

    def __init__(self, bottleneck, inputs, width, stride, dilation):
        super().__init__()
        outputs = width * (4 if bottleneck else 1)

        def conv(i, o, kernel, stride):
            rate = dilation if kernel == 3 else 1
            return nn.Conv2d(i, o, kernel, stride, kernel // 2 * rate, rate, bias=False)

        self.conv1 = conv(inputs, width, 1, 1) if bottleneck else conv(inputs, width, 3, stride)
        self.bn1 = nn.BatchNorm2d(width)
        self.conv2 = conv(width, width, 3, stride if bottleneck else 1)
        self.bn2 = nn.BatchNorm2d(width)
        if bottleneck:
            self.conv3 = conv(width, outputs, 1, 1)
            self.bn3 = nn.BatchNorm2d(outputs)
        self.bottleneck = bottleneck
        self.downsample = None
        if stride != 1 or inputs != outputs:
            self.downsample = nn.Sequential(conv(inputs, outputs, 1, stride), nn.BatchNorm2d(outputs))

    def forward(self, x):
        y = F.relu(self.bn1(self.conv1(x)))
        y = self.bn2(self.conv2(y))
        if self.bottleneck:
            y = self.bn3(self.conv3(F.relu(y)))
        return F.relu(y + (x if self.downsample is None else self.downsample(x)))


class ResNet(nn.Module):
    BLOCKS = {18: (2, 2, 2, 2), 34: (3, 4, 6, 3), 50: (3, 4, 6, 3), 101: (3, 4, 23, 3)}

    def __init__(self, depth, base_width=64, output_stride=32, multi_grid=(1, 2, 4)):
        super().__init__()
        bottleneck = depth >= 50
        self.conv1 = nn.Conv2d(3, base_width, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(base_width)
        inputs, self.channels = base_width, [base_width]
        for layer, blocks in enumerate(self.BLOCKS[depth]):
            width, made = base_width << layer, []
            for block in range(blocks):
                stride, dilation = (2 if layer > 0 and block == 0 else 1), 1
                if layer == 3 and output_stride == 16:
                    stride, dilation = 1, 2 * multi_grid[block]
                made.append(Block(bottleneck, inputs, width, stride, dilation))
                inputs = width * (4 if bottleneck else 1)
            setattr(self, f"layer{layer + 1}", nn.Sequential(*made))
            self.channels.append(inputs)
        self.register_buffer("mean", torch.tensor([0.485, 0.456, 0.406]).view(1, 3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor([0.229, 0.224, 0.225]).view(1, 3, 1, 1), persistent=False)

    def forward(self, image):
        feats = [F.relu(self.bn1(self.conv1((image - self.mean) / self.std)))]
        x = F.max_pool2d(feats[0], 3, 2, 1)
        for layer in (self.layer1, self.layer2, self.layer3, self.layer4):
            x = layer(x)
            feats.append(x)
        return feats


class ConvNorm(nn.Module):
    def __init__(self, inputs, outputs, kernel=1, rate=1):
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, kernel, padding=kernel // 2 * rate, dilation=rate, bias=False)
        self.bn = nn.BatchNorm2d(outputs)

    def forward(self, x):
        return F.relu(self.bn(self.conv(x)))


class HierarchicalContext(nn.Module):
    def __init__(self, channels, rates=(3, 6, 12), global_pool=True, reduce_first=True, min_width=32):
        super().__init__()
        width = self.width = max(channels // 4, min_width)
        self.point = ConvNorm(channels, width)
        self.reduce = ConvNorm(channels, width) if reduce_first else nn.Identity()
        self.dilated = nn.ModuleList(ConvNorm(width if reduce_first else channels, width, 3, r) for r in rates)
        self.add_module("global", nn.Conv2d(channels, width, 1) if global_pool else None)
        self.project = ConvNorm((1 + len(rates) + bool(global_pool)) * width, width)

    def forward(self, x):
        reduced = self.reduce(x)
        branches = [self.point(x)] + [dilated(reduced) for dilated in self.dilated]
        pool = getattr(self, "global")
        if pool is not None:
            mean = F.relu(pool(F.adaptive_avg_pool2d(x, 1)))
            branches.append(mean.expand(-1, -1, *x.shape[2:]))
        return self.project(torch.cat(branches, 1))


class Attention(nn.Module):
    def __init__(self, channels, form="product", reduction=16, kernel=7):
        super().__init__()
        hidden = -(-channels // reduction)
        self.squeeze = nn.Conv2d(channels, hidden, 1, bias=False)
        self.excite = nn.Conv2d(hidden, channels, 1, bias=False)
        self.spatial = nn.Conv2d(2, 1, kernel, padding=kernel // 2, bias=False)
        self.form = form

    def masks(self, x):
        channel = torch.sigmoid(self.excite(F.relu(self.squeeze(F.adaptive_avg_pool2d(x, 1)))))
        extent = torch.cat([x.mean(1, keepdim=True), x.max(1, keepdim=True).values], 1)
        return channel, torch.sigmoid(self.spatial(extent))

    def forward(self, x):
        channel, spatial = self.masks(x)
        both = spatial * channel
        return x * (both if self.form == "product" else 1 + both)


class Aggregation(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.project = nn.Conv2d(channels, channels, 1)

    def forward(self, x):
        return x + self.project(F.adaptive_avg_pool2d(x, 1))


class Stage(nn.Module):
    def __init__(self, inputs, skip, width, enlarge):
        super().__init__()
        self.reduce = nn.Conv2d(inputs, width, 3, padding=1, padding_mode="reflect")
        self.fuse = nn.Conv2d(width + skip, width, 3, padding=1, padding_mode="reflect")
        self.enlarge = enlarge

    def forward(self, x, skip):
        x = F.elu(self.reduce(x))
        if self.enlarge:
            x = F.interpolate(x, scale_factor=2, mode="nearest")
        return F.elu(self.fuse(x if skip is None else torch.cat([x, skip], 1)))


class Decoder(nn.Module):
    def __init__(self, channels, widths, output_stride):
        super().__init__()
        inputs, stages = channels[4], []
        for i, width in enumerate(widths):
            skip = channels[3 - i] if i < 4 else 0
            stages.append(Stage(inputs, skip, width, i > 0 or output_stride == 32))
            inputs = width
        self.stages = nn.ModuleList(stages)
        heads = [nn.Conv2d(widths[4 - s], 1, 3, padding=1, padding_mode="reflect") for s in range(4)]
        self.heads = nn.ModuleList(heads)

    def forward(self, feats):
        x, disparities = feats[4], []
        for i, stage in enumerate(self.stages):
            x = stage(x, feats[3 - i] if i < 4 else None)
            if i > 0:
                disparities.insert(0, torch.sigmoid(self.heads[4 - i](x)))
        return disparities


class DepthNet(nn.Module):
    """The paper's depth network; the defaults are those of its preset."""

    def __init__(self, depth=50, base_width=64, widths=(256, 128, 64, 32, 16), output_stride=16, form="product"):
        super().__init__()
        self.encoder = ResNet(depth, base_width, output_stride)
        channels = list(self.encoder.channels)
        self.hce = nn.ModuleList(HierarchicalContext(c) for c in channels[1:])
        channels[1:] = [hce.width for hce in self.hce]
        self.attention = nn.ModuleList(Attention(c, form) for c in channels[1:])
        self.aggregation = Aggregation(channels[4])
        self.decoder = Decoder(channels, widths, output_stride)

    def forward(self, image):
        feats = self.encoder(image)
        for k in range(1, 5):
            feats[k] = self.attention[k - 1](self.hce[k - 1](feats[k]))
        feats[4] = self.aggregation(feats[4])
        return self.decoder(feats)


# --- what is written -----------------------------------------------------------------------------------------


def keep(expected, name, tensor):
    values = tensor.detach().flatten()
    stride = 1 if len(values) <= AT_MOST else (len(values) // AT_MOST) | 1
    expected[name] = values[::stride].float().numpy()


def case(expected, name, module, shape, train=True):
    """Output, and the gradients of input and weights, under the loss Σ mean(output·pattern).

    A sum near 0 before a ReLU may be on the other side of 0 in float32, with a different gradient. The smallest distance
    is printed, and the choices here (sizes; running statistics in the deepest network) keep it large.
    """
    from networks import fill, uniform

    module = fill(module).double().train(train)
    nearest = []
    for part in module.modules():
        if isinstance(part, nn.BatchNorm2d):
            part.register_forward_hook(lambda _, __, output: nearest.append(output.detach().abs().min().item()))
    values = uniform(f"{name}/x", int(np.prod(shape)), None) * np.float32(0.5) + np.float32(0.5)
    x = torch.from_numpy(values.reshape(shape)).double().requires_grad_()
    outputs = module(x)
    outputs = outputs if isinstance(outputs, (list, tuple)) else [outputs]
    loss = 0.0
    for i, output in enumerate(outputs):
        pattern = uniform(f"{name}/pattern{i}", output.numel(), None).reshape(output.shape)
        loss = loss + (output * torch.from_numpy(pattern).double()).mean()
        keep(expected, f"{name}/output{i}", output)
    loss.backward()
    if nearest:
        print(f"{name}: nearest to a kink {min(nearest):.1e}")
    keep(expected, f"{name}/grad/x", x.grad)
    for key, parameter in module.named_parameters():
        if parameter.grad is not None:
            keep(expected, f"{name}/grad/{key}", parameter.grad)


def check_resnet():
    """Checks that the dilated ResNet above equals torchvision's with `replace_stride_with_dilation` and the grid applied."""
    theirs = torchvision.models.resnet50(weights=None, replace_stride_with_dilation=[False, False, True]).eval()
    for block, rate in zip(theirs.layer4, (2, 4, 8)):
        block.conv2.dilation = block.conv2.padding = (rate, rate)
    ours = ResNet(50, output_stride=16).eval()
    state = {k: v for k, v in theirs.state_dict().items() if not k.startswith("fc.")}
    ours.load_state_dict(state)
    image = torch.rand(1, 3, 64, 96)
    normalised = (image - ours.mean) / ours.std
    x = theirs.maxpool(theirs.relu(theirs.bn1(theirs.conv1(normalised))))
    for layer in (theirs.layer1, theirs.layer2, theirs.layer3, theirs.layer4):
        x = layer(x)
    assert torch.allclose(x, ours(image)[4], rtol=1e-4, atol=1e-5)


class Coarsest(ResNet):
    def forward(self, image):
        return super().forward(image)[3:]


def main():
    from networks import write_safetensors

    torch.manual_seed(0)
    check_resnet()
    expected = {}
    # Wider than high, and smaller than the reach of the largest rate: whole rows of taps read only zeros.
    case(expected, "hce", HierarchicalContext(24), (2, 24, 9, 17))
    case(expected, "hce_evaluated", HierarchicalContext(24), (2, 24, 9, 17), train=False)
    plain = HierarchicalContext(140, rates=(1, 2), global_pool=False, reduce_first=False)
    case(expected, "hce_plain", plain, (2, 140, 5, 8))
    for form in ("product", "residual"):
        case(expected, f"attention_{form}", Attention(40, form), (2, 40, 9, 11))
    case(expected, "aggregation", Aggregation(20), (2, 20, 5, 7))
    for depth in (18, 50):
        case(expected, f"dilated_{depth}", Coarsest(depth, 8, 16), (2, 3, 96, 128), train=False)
    case(expected, "paper_18", DepthNet(18, 16, (24, 16, 16, 8, 8)), (2, 3, 64, 96))
    case(expected, "paper_50", DepthNet(50, 8, (24, 16, 16, 8, 8), form="residual"), (2, 3, 64, 96), train=False)
    write_safetensors(Path(__file__).parent / "depth_network.safetensors", expected)
    print(f"{len(expected)} tensors, {sum(a.size for a in expected.values())} values")


if __name__ == "__main__":
    main()
