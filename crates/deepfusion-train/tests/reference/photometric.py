"""The photometric error of the losses' references: `alpha` of the structural dissimilarity in 3x3 windows, the rest |a - b|."""

import torch.nn.functional as F

ALPHA = 0.85


def photometric(a, b, alpha=ALPHA):
    def mean(x):
        return F.avg_pool2d(F.pad(x, [1] * 4, mode="reflect"), 3, 1)

    ma, mb = mean(a), mean(b)
    va, vb = mean(a * a) - ma * ma, mean(b * b) - mb * mb
    cov = mean(a * b) - ma * mb
    ssim = (2 * ma * mb + 1e-4) * (2 * cov + 9e-4) / ((ma**2 + mb**2 + 1e-4) * (va + vb + 9e-4))
    unlike = ((1 - ssim) / 2).clamp(0, 1)
    return (alpha * unlike + (1 - alpha) * (a - b).abs()).mean(1, keepdim=True)
