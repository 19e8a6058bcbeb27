#!/usr/bin/env python3
"""How many images a second become depth on disk, by the command and through Python, and how that grows with their number.

    benches/bulk/throughput.py DEEPFUSION OUT [--images 300] [--times 1 2 4] [--repeats 3] [--precision f32]

simulates a drive of `--images` images of 640x192, links them 1, 2 and 4 times over, and predicts them with the embedded network: as NumPy files by
`deepfusion predict --save npy`, and by the package's `Model.predict_many` and `Model.predict` (one by one) with `numpy.save` (where the package is
installed), in turns. Prints, for each number of images, the median of the images a second, their ratio to the command's, and what an image takes on
disk. `--shards` also runs the command as two processes of one thread each, `--ray` `deepfusion.ray.predict` with one worker of two cores and with two
of one (Ray is started beforehand).
"""

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

try:
    import deepfusion
    import numpy
except ImportError:
    deepfusion = None


def run(program, *words, threads=None):
    environment = dict(os.environ)
    if threads is not None:
        environment["RAYON_NUM_THREADS"] = str(threads)
    return subprocess.Popen([program, *map(str, words)], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait(process):
    _, err = process.communicate()
    if process.returncode != 0:
        sys.exit(err)


def simulated(program, folder, count):
    """A drive's images, and its date's folder with the calibration."""
    if not folder.exists():
        wait(run(program, "simulate", "--out", folder, "--frames", count, "--seed", 77, "--moving-cars", 4, "--scan-every", 0))
    images = sorted(next(folder.rglob("image_02")).joinpath("data").iterdir())
    return images, next(folder.rglob("calib_cam_to_cam.txt")).parent


def linked(images, folder, times):
    """The same images several times, by other names."""
    folder.mkdir()
    for copy in range(times):
        for image in images:
            os.link(image, folder / f"{copy:02}_{image.name}")
    return sorted(folder.iterdir())


def by_command(program, inputs, calibration, out, precision, shards=1):
    begin = time.perf_counter()
    words = ["predict", inputs, "--model", "street", "--calib", calibration, "--save", "npy", "--precision", precision, "--out", out]
    if shards == 1:
        wait(run(program, *words))
    else:
        each = [run(program, *words, "--shard", f"{i + 1}/{shards}", threads=1) for i in range(shards)]
        for process in each:
            wait(process)
    return time.perf_counter() - begin


def by_python(files, intrinsics, out, precision, many=True):
    begin = time.perf_counter()
    out.mkdir()
    model = deepfusion.load("street", precision=precision)
    each = model.predict_many(files, intrinsics) if many else (model.predict(file, intrinsics) for file in files)
    for file, seen in zip(files, each):
        numpy.save(out / f"{file.stem}.npy", seen.depth)
    return time.perf_counter() - begin


def by_ray(files, intrinsics, out, precision, workers):
    import deepfusion.ray

    begin = time.perf_counter()
    cores = {"cpus_per_worker": 2 // workers}
    summary = deepfusion.ray.predict(files[0].parent, "street", out, intrinsics=intrinsics, save=["npy"], precision=precision, workers=workers, **cores)
    if summary.failed:
        sys.exit(f"{summary.failed[0]}")
    return time.perf_counter() - begin


def main():
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("program")
    words.add_argument("out", type=Path)
    words.add_argument("--images", type=int, default=300)
    words.add_argument("--times", type=int, nargs="+", default=[1, 2, 4])
    words.add_argument("--repeats", type=int, default=3)
    words.add_argument("--precision", default="f32")
    words.add_argument("--shards", action="store_true")
    words.add_argument("--ray", action="store_true")
    asked = words.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    images, calibration = simulated(asked.program, asked.out / "drive", asked.images)
    intrinsics = None
    if deepfusion is not None:
        intrinsics = deepfusion.Dataset(next(calibration.glob("*_sync")))[0].intrinsics
    ways = {"command": lambda files, out: by_command(asked.program, files[0].parent, calibration, out, asked.precision)}
    if asked.shards:
        ways["2 processes"] = lambda files, out: by_command(asked.program, files[0].parent, calibration, out, asked.precision, 2)
    if deepfusion is not None:
        ways["Python"] = lambda files, out: by_python(files, intrinsics, out, asked.precision)
        ways["one by one"] = lambda files, out: by_python(files, intrinsics, out, asked.precision, many=False)
    if asked.ray:
        import ray

        ray.init(num_cpus=2, include_dashboard=False)
        ways["Ray, 1 worker"] = lambda files, out: by_ray(files, intrinsics, out, asked.precision, 1)
        ways["Ray, 2 workers"] = lambda files, out: by_ray(files, intrinsics, out, asked.precision, 2)
    print("| images | " + " | ".join(f"{way}, images/s" for way in ways) + " | over the command | kB an image |")
    print("|---|" + "---|" * len(ways) + "---|---|")
    for times in asked.times:
        inputs = asked.out / f"images-{times}"
        shutil.rmtree(inputs, ignore_errors=True)
        files = linked(images, inputs, times)
        seconds = {way: [] for way in ways}
        size = 0
        for _ in range(asked.repeats):
            for way, work in ways.items():
                out = asked.out / "depth"
                shutil.rmtree(out, ignore_errors=True)
                seconds[way].append(work(files, out))
                size = sum(f.stat().st_size for f in out.rglob("*.npy")) / len(files)
        rates = {way: len(files) / statistics.median(times) for way, times in seconds.items()}
        others = ", ".join(f"{rate / rates['command']:.2f}" for way, rate in rates.items() if way != "command")
        print(f"| {len(files)} | " + " | ".join(f"{rate:.1f}" for rate in rates.values()) + f" | {others or '–'} | {size / 1000:.0f} |", flush=True)
        shutil.rmtree(inputs)


if __name__ == "__main__":
    main()
