#!/usr/bin/env python3
"""Every preset at an equal budget, under one protocol, in one table.

    benches/presets.py DEEPFUSION OUT --data DRIVE ... --eval DRIVE [--steps 300] [--size 192x64] [--precision f32] [--workers 2]

trains each preset from random weights on the same drives (both cameras where there are two, batch 4, the preset's own losses; the rest is in `SETTINGS`),
measures the last checkpoint on the drive of `--eval` (`--gt-depth z --crop garg --cap 80`), and times the network at 640x192 in f32 and bf16 with
`bench`. What is trained or measured already is not done again, so the script may be stopped. Prints Markdown.

The preset `resnet50` is `paper` with all of its own switched off: context, attention, aggregation, the encoder's stride of 16, affine, flow and masks.

--workers trains that many presets at a time, each by its share of the cores. Minutes are the processor's: user and system time.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

PRESETS = [
    "sfmlearner", "monodepth2", "monodepth2-50", "r-msfm3", "r-msfm6", "lite-mono-tiny", "lite-mono-small", "lite-mono", "lite-mono-8m",
    "tiny", "light", "resnet50", "paper",
]
# The same for all: views warped by as much of the measured motion as a drive's sensors know, which makes every row metric; a learning rate that falls by a
# cosine.
SETTINGS = """view_motion = "auto"
learning_rate = 3e-4
learning_rate_schedule = "cosine"
learning_rate_warmup_steps = 20
validation_share = 0.02
"""
BENCH_SIZE = "640x192"


def timed(words, out, threads):
    """Runs a command with its output in a file; the processor's seconds and the most memory it held, in GiB."""
    environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    with out.open("w") as file:
        process = subprocess.Popen([*map(str, words)], env=environment, stdout=file, stderr=subprocess.STDOUT)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{words}: {out.read_text()[-2000:]}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 2**20


def answer(words):
    run = subprocess.run([*map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if run.returncode != 0:
        sys.exit(run.stderr)
    return json.loads(run.stdout)


def kept(path, make):
    """What is in a file of JSON, made first where it is not there."""
    if not path.exists():
        value = make()
        new = path.with_suffix(".new")
        new.write_text(json.dumps(value))
        new.rename(path)
    return json.loads(path.read_text())


def config(asked, preset):
    paths = ", ".join(json.dumps(str(path.resolve())) for path in asked.data)
    return f'preset = "{preset}"\n{SETTINGS}precision = "{asked.precision}"\n\n[data]\ncamera = "both"\npaths = [{paths}]\n'


def trained(asked, preset):
    folder = asked.out / preset
    folder.mkdir(parents=True, exist_ok=True)

    def make():
        # What was stopped begins anew: its time counts.
        shutil.rmtree(folder / "run", ignore_errors=True)
        (folder / "config.toml").write_text(config(asked, preset))
        train = [asked.program, "train", "--config", folder / "config.toml", "--init", "none", "--size", asked.size, "--batch", 4]
        train += ["--steps", asked.steps, "--out", folder / "run"]
        seconds, gib = timed(train, folder / "train.log", max(1, os.cpu_count() // asked.workers))
        return {"seconds": seconds, "gib": gib}

    cost = kept(folder / "cost.json", make)
    measure = [asked.program, "eval", "--model", folder / "run/last.safetensors", "--data", asked.eval, "--gt-depth", "z", "--crop", "garg"]
    return cost, kept(folder / "eval.json", lambda: answer([*measure, "--cap", 80, "--json"]))


def timed_network(asked, preset, precision):
    """Of `bench`: parameters, multiply-adds, milliseconds of the network, MB of the process."""
    words = [asked.program, "bench", "--preset", preset, "--size", BENCH_SIZE, "--repeats", 15, "--precision", precision, "--json"]
    return kept(asked.out / f"{preset}-{precision}.json", lambda: answer(words))


def row(asked, preset, cost, measured):
    f32, bf16 = (timed_network(asked, preset, precision) for precision in ("f32", "bf16"))
    scale = measured["scale"]["median"]
    unscaled, scaled = measured["unscaled"], measured["median_scaled"]
    return [
        f"`{preset}`",
        f"{unscaled['abs_rel']:.3f}", f"{scaled['abs_rel']:.3f}", f"{scale:.2f}", f"{scaled['rmse']:.2f}", f"{scaled['a1']:.2f}",
        f"{cost['seconds'] / 60:.1f}", f"{cost['gib']:.1f}",
        f"{f32['parameters'] / 1e6:.1f}", f"{2 * f32['multiply_adds'] / 1e9:.1f}",
        f"{f32['stages_ms']['network']:.0f}; {bf16['stages_ms']['network']:.0f}", f"{f32['peak_rss_mb']:.0f}; {bf16['peak_rss_mb']:.0f}",
    ]


def main():
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("program")
    words.add_argument("out", type=Path)
    words.add_argument("--data", type=Path, nargs="+", required=True)
    words.add_argument("--eval", type=Path, required=True)
    words.add_argument("--steps", type=int, default=300)
    words.add_argument("--size", default="192x64")
    words.add_argument("--precision", choices=["f32", "bf16"], default="f32", help="of the training")
    words.add_argument("--workers", type=int, default=1)
    words.add_argument("--presets", nargs="+", choices=PRESETS, default=PRESETS)
    asked = words.parse_args()
    with ThreadPoolExecutor(asked.workers) as pool:
        results = list(pool.map(lambda preset: trained(asked, preset), asked.presets))
    head = [
        "preset", "abs_rel, unscaled", "scaled", "`scale.median`", "RMSE, scaled", "δ1, scaled", "training, processor minutes", "GiB",
        "parameters, M", "GFLOP", "ms, f32; bf16", "MB, f32; bf16",
    ]
    print("| " + " | ".join(head) + " |\n" + "|---" * len(head) + "|")
    for preset, (cost, measured) in zip(asked.presets, results):
        print("| " + " | ".join(row(asked, preset, cost, measured)) + " |", flush=True)


if __name__ == "__main__":
    main()
