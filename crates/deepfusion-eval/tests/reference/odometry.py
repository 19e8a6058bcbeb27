"""Reference values of odometry errors: drifting paths, scored by evo (RPE, ATE) and by KITTI's definition in NumPy.

Needs Python with NumPy and evo (`pip install evo`, GPL; called here, nothing of it is in this project). Run by hand in
this folder; writes odometry.json.
"""

import json

import numpy as np
from evo.core import lie_algebra, metrics
from evo.core.trajectory import PosePath3D
from scipy.spatial.transform import Rotation

LENGTHS = [100, 200, 300, 400, 500, 600, 700, 800]
SHORT = [10, 20, 30, 40, 50]


def path(rng, frames, step, bend):
    """A winding road: camera axes, x right, y down, z forward."""
    pose, poses = np.eye(4), []
    for i in range(frames):
        poses.append(pose)
        turn = Rotation.from_rotvec([0.002 * rng.normal(), bend * np.sin(0.03 * i), 0.001 * rng.normal()])
        pose = pose @ lie_algebra.se3(turn.as_matrix(), [0.02 * rng.normal(), 0.0, step * (1 + 0.2 * np.sin(0.05 * i))])
    return poses


def drifting(rng, poses, scale):
    """The same path as an odometry would see it: scaled, noisy, with a turn of its own."""
    seen = [np.eye(4)]
    for a, b in zip(poses, poses[1:]):
        motion = lie_algebra.relative_se3(a, b)
        noise = Rotation.from_rotvec(0.002 * rng.normal(size=3) + [0.0, 0.0006, 0.0])
        motion = lie_algebra.se3(
            motion[:3, :3] @ noise.as_matrix(), scale * motion[:3, 3] + 0.01 * rng.normal(size=3)
        )
        seen.append(seen[-1] @ motion)
    return seen


def kitti(truth, seen, lengths, step):
    """The benchmark's definition (Geiger et al., CVPR 2012): errors over stretches of the true path."""
    along = np.concatenate([[0], np.cumsum([np.linalg.norm(b[:3, 3] - a[:3, 3]) for a, b in zip(truth, truth[1:])])])
    t, r = {n: [] for n in lengths}, {n: [] for n in lengths}
    for first in range(0, len(truth), step):
        for length in lengths:
            beyond = np.nonzero(along > along[first] + length)[0]
            if len(beyond) == 0:
                continue
            last = beyond[0]
            true_motion = np.linalg.inv(truth[first]) @ truth[last]
            seen_motion = np.linalg.inv(seen[first]) @ seen[last]
            error = np.linalg.inv(seen_motion) @ true_motion
            angle = np.arccos(np.clip((np.trace(error[:3, :3]) - 1) / 2, -1, 1))
            t[length].append(np.linalg.norm(error[:3, 3]) / length)
            r[length].append(angle / length)
    every = [v for n in lengths for v in t[n]], [v for n in lengths for v in r[n]]
    return {
        "t_rel_percent": 100 * np.mean(every[0]),
        "r_rel_deg_per_m": np.degrees(np.mean(every[1])),
        "lengths": [
            {"length_m": n, "n": len(t[n]), "t_rel_percent": 100 * np.mean(t[n]),
             "r_rel_deg_per_m": np.degrees(np.mean(r[n]))}
            for n in lengths if t[n]
        ],
    }


def evo_numbers(truth, seen):
    rpe = {}
    for name, relation in [("rpe_m", metrics.PoseRelation.translation_part),
                           ("rpe_deg", metrics.PoseRelation.rotation_angle_deg)]:
        metric = metrics.RPE(relation, 1, metrics.Unit.frames, all_pairs=False)
        metric.process_data((PosePath3D(poses_se3=truth), PosePath3D(poses_se3=seen)))
        rpe[name] = metric.get_statistic(metrics.StatisticsType.rmse)
    ate = []
    for first in range(len(truth) - 4):
        a = PosePath3D(poses_se3=truth[first:first + 5])
        b = PosePath3D(poses_se3=seen[first:first + 5])
        b.align_origin(a)
        metric = metrics.APE(metrics.PoseRelation.translation_part)
        metric.process_data((a, b))
        ate.append(metric.get_statistic(metrics.StatisticsType.rmse))
    return rpe | {"ate_m": np.mean(ate)}


def sfmlearner(truth, seen):
    """The published tables' five-frame error: one scale a snippet, root of the sum over the number of frames."""
    errors = []
    for first in range(len(truth) - 4):
        a, b = ([(np.linalg.inv(p[first]) @ q)[:3, 3] for q in p[first:first + 5]] for p in (truth, seen))
        a, b = np.array(a), np.array(b)
        errors.append(np.sqrt(np.sum((b * np.sum(a * b) / np.sum(b * b) - a) ** 2)) / 5)
    return np.mean(errors)


def case(name, seed, frames, step, bend, scale, lengths, every):
    rng = np.random.default_rng(seed)
    truth = path(rng, frames, step, bend)
    seen = drifting(rng, truth, scale)
    # The files' digits are what both sides score.
    rows = [[[float(f"{v:.9e}") for v in p[:3].ravel()] for p in poses] for poses in (truth, seen)]
    truth, seen = ([np.vstack([np.reshape(r, (3, 4)), [0, 0, 0, 1]]) for r in part] for part in rows)
    shifts = [[np.linalg.norm(b[:3, 3] - a[:3, 3]) for a, b in zip(p, p[1:])] for p in (truth, seen)]
    expected = kitti(truth, seen, lengths, every) | evo_numbers(truth, seen) | {
        "ate_scaled_m": sfmlearner(truth, seen),
        "scale": np.median(np.array(shifts[0]) / np.array(shifts[1])),
    }
    return {"name": name, "truth": rows[0], "predicted": rows[1], "expected": expected}


cases = [
    case("long", 1, 220, 1.3, 0.02, 0.97, LENGTHS, 10),
    case("short", 2, 60, 1.0, 0.03, 1.08, SHORT, 1),
]
with open("odometry.json", "w") as file:
    json.dump(cases, file, default=float)
