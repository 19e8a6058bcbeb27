"""The peer of `cargo bench -p deepfusion-train`: the same networks in PyTorch, eager, on the same threads.

pip install torch torchvision
python benches/peers/torch_step.py [--threads 2]

Prints the median of ten runs of: forward + backward of the ResNet-18 depth network at 320x96, batch 4; the same with
clipped fused Adam, and that of the ResNet-50 network at 640x192, batch 2; inference of both networks at 640x192. Both
memory layouts are timed; the better one is the peer's figure.
"""
import argparse
import statistics
import time

import torch
import torch.nn as nn
import torch.nn.functional as F
import torchvision


LEARNING_RATE, CLIP_NORM = 1e-4, 10.0


class Reflected(nn.Sequential):
    def __init__(self, channels_in, channels_out):
        super().__init__(nn.ReflectionPad2d(1), nn.Conv2d(channels_in, channels_out, 3))


class DepthNet(nn.Module):
    """ResNet features, five upsampling stages with skips, four sigmoid heads."""

    WIDTHS = (256, 128, 64, 32, 16)

    def __init__(self, depth):
        super().__init__()
        self.resnet = getattr(torchvision.models, f"resnet{depth}")()
        e = 4 if depth >= 50 else 1
        features = [64, 64 * e, 128 * e, 256 * e, 512 * e]
        skips = features[3::-1] + [0]
        inputs = [features[4], *self.WIDTHS[:4]]
        self.reduce = nn.ModuleList(Reflected(i, o) for i, o in zip(inputs, self.WIDTHS))
        self.fuse = nn.ModuleList(Reflected(o + s, o) for o, s in zip(self.WIDTHS, skips))
        self.heads = nn.ModuleList(Reflected(w, 1) for w in self.WIDTHS[1:])

    def forward(self, x):
        r = self.resnet
        x = (x - 0.45) / 0.225
        x = r.relu(r.bn1(r.conv1(x)))
        skips = [x]
        x = r.maxpool(x)
        for layer in (r.layer1, r.layer2, r.layer3, r.layer4):
            x = layer(x)
            skips.append(x)
        skips = skips[3::-1]
        outputs = []
        for i in range(5):
            x = F.interpolate(F.elu(self.reduce[i](x)), scale_factor=2)
            if i < 4:
                x = torch.cat([x, skips[i]], 1)
            x = F.elu(self.fuse[i](x))
            if i > 0:
                outputs.append(torch.sigmoid(self.heads[i - 1](x)))
        return outputs


def median_ms(work, runs=10):
    work()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times)


def gradients(net, x):
    net.zero_grad()
    sum(d.mean() for d in net(x)).backward()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--threads", type=int, default=2)
    torch.set_num_threads(parser.parse_args().threads)
    for layout, name in ((torch.contiguous_format, "NCHW"), (torch.channels_last, "channels last")):
        net = DepthNet(18).to(memory_format=layout)
        x = torch.rand(4, 3, 96, 320).to(memory_format=layout)
        ms = median_ms(lambda: gradients(net, x))
        print(f"depth net forward + backward, ResNet-18, 320x96, batch 4, {name}: {ms:.1f} ms")
        for depth, (batch, height, width) in ((18, (4, 96, 320)), (50, (2, 192, 640))):
            net = DepthNet(depth).to(memory_format=layout)
            x = torch.rand(batch, 3, height, width).to(memory_format=layout)
            optimiser = torch.optim.Adam(net.parameters(), LEARNING_RATE, fused=True)

            def step():
                gradients(net, x)
                nn.utils.clip_grad_norm_(net.parameters(), CLIP_NORM)
                optimiser.step()

            what = f"depth net forward + backward + Adam, ResNet-{depth}, {width}x{height}, batch {batch}"
            print(f"{what}, {name}: {median_ms(step):.1f} ms")
        for depth in (18, 50):
            net = DepthNet(depth).eval().to(memory_format=layout)
            x = torch.rand(1, 3, 192, 640).to(memory_format=layout)
            with torch.inference_mode():
                ms = median_ms(lambda: net(x))
            print(f"inference, ResNet-{depth}, 640x192, {name}: {ms:.1f} ms")


if __name__ == "__main__":
    main()
