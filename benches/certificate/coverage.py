#!/usr/bin/env python3
"""How often the scale certificate's 95 % interval holds the true scale.

Simulates drives that the embedded network never saw, tells the program the truth about them or something wrong (the focal length, the
vehicle's speed), and compares the certificate of `deepfusion eval` with `scale.median` by the simulator's exact depth.

    benches/certificate/coverage.py DEEPFUSION OUT [--seeds 8] [--model street] [--real KITTI-DRIVE ...]

writes OUT/coverage.csv, a row a drive, and prints a table; rows that are there already are not measured again. `--real` adds copies of recorded
drives in KITTI raw's layout, true by their scans. Nothing but Python's standard library is needed.
"""

import argparse
import csv
import json
import math
import shutil
import subprocess
import sys
from pathlib import Path

SCENES = ["urban", "commercial", "park", "night", "garage", "urban"]
FRAMES = 100
# Name, factor on the focal length, factor on the speeds, the camera's height in metres.
CASES = [
    ("as it is", 1.0, 1.0, 1.65),
    ("focal length + 10 %", 1.1, 1.0, 1.65),
    ("focal length - 10 %", 0.9, 1.0, 1.65),
    ("speed + 5 %", 1.0, 1.05, 1.65),
    ("speed - 5 %", 1.0, 0.95, 1.65),
    ("camera at 1.1 m", 1.0, 1.0, 1.1),
    ("camera at 2.4 m", 1.0, 1.0, 2.4),
]


def run(program, *words):
    done = subprocess.run([program, *map(str, words)], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))}\n{done.stderr}")
    return done.stdout


def drive_folder(root):
    """The folder with the images, and the one with its calibration above it."""
    drive = next(root.rglob("oxts")).parent
    return drive, drive.parent


def scale_focal_length(date, factor):
    path = date / "calib_cam_to_cam.txt"
    lines = []
    for line in path.read_text().splitlines():
        name, _, values = line.partition(":")
        numbers = values.split()
        if name.startswith("P_rect"):
            # fx and fy, and the baseline's term, which is a multiple of fx.
            for place in (0, 3, 5):
                numbers[place] = repr(float(numbers[place]) * factor)
        elif name.startswith("K_"):
            for place in (0, 4):
                numbers[place] = repr(float(numbers[place]) * factor)
        lines.append(f"{name}: {' '.join(numbers)}" if values else line)
    path.write_text("\n".join(lines) + "\n")


def scale_speed(drive, factor):
    for path in (drive / "oxts" / "data").glob("*.txt"):
        values = path.read_text().split()
        # vn, ve, vf, vl, vu of KITTI's oxts.
        for place in range(6, 11):
            values[place] = repr(float(values[place]) * factor)
        path.write_text(" ".join(values) + "\n")


def simulate(program, folder, height, seed):
    run(program, "simulate", "--out", folder, "--frames", FRAMES, "--seed", seed, "--scene", scene_of(seed),
        "--moving-cars", 3, "--camera-height", height, "--scan-every", 5)


def scene_of(seed):
    return SCENES[seed % len(SCENES)]


def copy(folder, drive):
    """A recorded drive and its calibration."""
    date = folder / drive.parent.name
    shutil.copytree(drive, date / drive.name)
    for calibration in drive.parent.glob("calib_*.txt"):
        shutil.copy(calibration, date)


def measure(program, model, folder, case, place, make):
    name, focal, speed, _ = case
    shutil.rmtree(folder, ignore_errors=True)
    make(folder)
    drive, date = drive_folder(folder)
    # The truth is that of the drive as it was simulated.
    truth = folder.with_suffix(".npz")
    run(program, "data", "export-gt", folder, "--out", truth)
    if focal != 1.0:
        scale_focal_length(date, focal)
    if speed != 1.0:
        scale_speed(drive, speed)
    asked = ("eval", "--model", model, "--data", folder, "--json")
    true = json.loads(run(program, *asked, "--gt", truth))["scale"]["median"]
    found = json.loads(run(program, *asked, "--assume-unseen"))
    shutil.rmtree(folder)
    truth.unlink()
    certificate = found["scale_certificate"] or {}
    low, high = certificate.get("scale_ci95") or (math.nan, math.nan)
    row = {
        "case": name, **place, "true": true,
        "scale": certificate.get("scale", math.nan), "low": low, "high": high,
        "blocks": certificate.get("blocks", 0), "points": certificate.get("points", 0),
        "verdict": certificate.get("verdict", "none"), "held": int(low <= true <= high),
        "why": found.get("no_certificate", ""),
    }
    for source in certificate.get("sources", []):
        row["sd_" + source["name"]] = source["sd"]
    return row


def table(rows):
    print("| drives | n | with an interval | truth inside | median of its width | largest error |")
    print("|---|---|---|---|---|---|")
    for case in [None, *dict.fromkeys(row["case"] for row in rows)]:
        some = [row for row in rows if case in (None, row["case"])]
        certified = [row for row in some if not math.isnan(row["low"])]
        widths = sorted(math.log(row["high"] / row["low"]) / 2 for row in certified)
        errors = [abs(math.log(row["scale"] / row["true"])) for row in some if not math.isnan(row["scale"])]
        width = f"± {100 * widths[len(widths) // 2]:.1f} %" if widths else "–"
        error = f"{100 * max(errors):.1f} %" if errors else "–"
        held = sum(row["held"] for row in certified)
        print(f"| {case or 'all'} | {len(some)} | {len(certified)} | {held} | {width} | {error} |")


def main():
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("program")
    words.add_argument("out", type=Path)
    words.add_argument("--seeds", type=int, default=8, help="drives of each case")
    words.add_argument("--first-seed", type=int, default=90_000)
    words.add_argument("--model", default="street")
    words.add_argument("--cases", type=int, default=len(CASES), help="the first so many cases")
    words.add_argument("--real", type=Path, nargs="*", default=[], help="recorded drives in KITTI raw's layout")
    asked = words.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    kept = asked.out / "coverage.csv"
    rows = read(kept)
    drives = [
        (case, {"scene": scene_of(seed), "seed": seed},
         lambda folder, height=case[3], seed=seed: simulate(asked.program, folder, height, seed))
        for seed in range(asked.first_seed, asked.first_seed + asked.seeds)
        for case in CASES[: asked.cases]
    ]
    # A recorded camera's height is what it is.
    drives += [
        (case, {"scene": drive.name, "seed": -1}, lambda folder, drive=drive: copy(folder, drive.resolve()))
        for drive in asked.real
        for case in CASES[: asked.cases] if case[3] == CASES[0][3]
    ]
    known = {(row["case"], row["scene"], row["seed"]) for row in rows}
    for case, place, make in drives:
        if (case[0], *place.values()) in known:
            continue
        row = measure(asked.program, asked.model, asked.out / "drive", case, place, make)
        rows.append(row)
        print({k: round(v, 4) if isinstance(v, float) else v for k, v in row.items()}, file=sys.stderr, flush=True)
        with open(kept, "w", newline="") as file:
            names = list(dict.fromkeys(key for row in rows for key in row))
            writer = csv.DictWriter(file, names)
            writer.writeheader()
            writer.writerows(rows)
    simulated = [row for row in rows if row["seed"] >= 0]
    for some in (simulated, [row for row in rows if row["seed"] < 0]):
        if some:
            table(some)
            print()


def read(path):
    """The rows of an earlier run."""
    if not path.exists():
        return []
    words = ("case", "scene", "verdict", "why")
    with open(path, newline="") as file:
        rows = [{k: v if k in words else float(v) for k, v in row.items() if v or k in words} for row in csv.DictReader(file)]
    return [row | {k: int(row[k]) for k in ("seed", "blocks", "points", "held")} for row in rows]


if __name__ == "__main__":
    main()
