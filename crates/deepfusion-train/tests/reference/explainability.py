#!/usr/bin/env python3
"""Reference values for the loss with explainability masks, from PyTorch.

    python crates/deepfusion-train/tests/reference/explainability.py

writes `explainability.safetensors` beside this file: errors of two sources, where they see a pixel, and logits of their masks (float32),
and the value and gradients of

    mean over sources and pixels of σ(logit)·(error where seen, else the unwarped error) + 0.2·mean of −ln σ(logit)

(Zhou et al., "Unsupervised Learning of Depth and Ego-Motion from Video", CVPR 2017, Sec. 3.3, with means for sums), in double precision.

Needs torch and numpy.
"""

import sys
from pathlib import Path

import numpy as np
import torch

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2] / "deepfusion-nn/tests/reference"))
from lite_mono import write_safetensors  # noqa: E402

SHAPE = (2, 1, 6, 10)
tensors = {}
rng = np.random.default_rng(11)


def given(name, values, grad=True):
    """An input, rounded to float32 before it is used."""
    values = np.asarray(values, dtype=np.float32)
    tensors[name] = values
    return torch.from_numpy(values).double().requires_grad_(grad)


def main():
    sources, inputs = [], {}
    for k in range(2):
        error = given(f"explainability/error{k}", rng.uniform(0, 1, SHAPE))
        unwarped = given(f"explainability/unwarped{k}", rng.uniform(0, 1, SHAPE), False)
        seen = given(f"explainability/seen{k}", rng.uniform(0, 1, SHAPE) > 0.3, False)
        logit = given(f"explainability/logit{k}", rng.normal(0, 1.5, SHAPE))
        sources.append((torch.where(seen > 0.5, error, unwarped), logit))
        inputs |= {f"error{k}": error, f"logit{k}": logit}
    errors, logits = (torch.stack(parts) for parts in zip(*sources))
    loss = (torch.sigmoid(logits) * errors).mean() - 0.2 * torch.nn.functional.logsigmoid(logits).mean()
    loss.backward()
    tensors["explainability/loss"] = loss.detach().reshape(1).float().numpy()
    for name, tensor in inputs.items():
        tensors[f"explainability/{name}.grad"] = tensor.grad.float().numpy()
    write_safetensors(HERE / "explainability.safetensors", tensors)
    print(f"loss {loss.item():.6f}")


if __name__ == "__main__":
    main()
