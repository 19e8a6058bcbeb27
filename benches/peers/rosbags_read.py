"""Reading bags beside PyPI's `rosbags`: every message of the same files as a value of its type, with the ratios.

pip install rosbags numpy
python benches/peers/rosbags_read.py

Builds the example `throughput`, has it write three bags, and then reads each in turn with it and with rosbags (in this
process: its start is not counted), alternating, from warm files. Medians of 7 (bz2: 5), and the fastest for machines that
are shared. Both open the bag, read it in time order and decode every message; pixels and points are views in both.
"""
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_typestore

ROOT = Path(__file__).parents[2]
EXAMPLE = ["cargo", "run", "--quiet", "--release", "-p", "deepfusion-rosbag", "--example", "throughput", "--"]
STORE = get_typestore(Stores.ROS1_NOETIC)


def ours(*arguments):
    return subprocess.run([*EXAMPLE, *map(str, arguments)], cwd=ROOT, check=True, capture_output=True, text=True).stdout


def theirs(bag):
    start = time.perf_counter()
    count = size = 0
    with Reader(bag) as reader:
        for connection, _, raw in reader.messages():
            STORE.deserialize_ros1(raw, connection.msgtype)
            count += 1
            size += len(raw)
    return time.perf_counter() - start, count, size


def main():
    with tempfile.TemporaryDirectory() as folder:
        ours("write", folder)
        for name, runs, needed in [("small_none.bag", 7, 10), ("large_lz4.bag", 7, 2), ("large_bz2.bag", 5, 1.2)]:
            bag = Path(folder) / name
            a, b = [], []
            for _ in range(runs):
                seconds, count, size = ours("read", bag).split()
                a.append(float(seconds))
                seconds, *same = theirs(bag)
                b.append(seconds)
                assert [int(count), int(size)] == same, (count, size, same)
            mine, peer = statistics.median(a), statistics.median(b)
            print(
                f"{name}: {count} messages, {int(size) / 1e6:.0f} MB ({bag.stat().st_size / 1e6:.0f} in the file): "
                f"deepfusion {mine * 1e3:.1f} ms (fastest {min(a) * 1e3:.1f}), rosbags {peer * 1e3:.1f} ms "
                f"(fastest {min(b) * 1e3:.1f}); {peer / mine:.1f} times as fast (fastest {min(b) / min(a):.1f}; "
                f"needed {needed})",
                flush=True,
            )


if __name__ == "__main__":
    main()
