"""Work on many machines, by Ray: bulk prediction, checks of a fleet's recordings, trials of configurations, and one network trained by
several workers.

Needs Ray (`pip install "deepfusion[ray]"`). Everything runs on the cluster that `ray.init()` has joined, or on this machine if it has
joined none. Inputs and outputs are paths or URLs of any file system that fsspec knows: a folder that all machines share,
`s3://bucket/folder` (with s3fs), `gs://…` (with gcsfs).
"""

from __future__ import annotations

from ._fleet import doctor, inspect, table
from ._predict import PredictSummary, predict
from ._train import train
from ._tune import Trial, ablate, tune

__all__ = ["PredictSummary", "Trial", "ablate", "doctor", "inspect", "predict", "table", "train", "tune"]
