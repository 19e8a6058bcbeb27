"""A drive's ROS 1 bag as bags of ROS 2, by PyPI's `rosbags` and `mcap`.

pip install rosbags numpy mcap lz4 zstandard
python crates/deepfusion-ros2bag/tests/reference/drive_to_ros2.py DRIVE.bag OUT [--thin N]

Writes OUT/mcap and OUT/sqlite (as rosbags records them), OUT/zstd.mcap, and OUT/bag.toml for all of them. With --thin
every cloud keeps only each Nth point, and OUT/drive.bag is the ROS 1 bag of the same messages: that is how `drive/` here
was made, from

deepfusion simulate --out tiny --format bag --scene urban --frames 10 --size 64x48 --moving-cars 2 --seed 5
"""
import argparse
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import ros2_reference as ros2
from mcap.writer import CompressionType
from rosbags.rosbag1 import Reader
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin

ros1 = ros2.ros1


def thinned(cloud, step):
    points = np.frombuffer(cloud.data.tobytes(), np.uint8).reshape(-1, cloud.point_step)[::step]
    data = np.ascontiguousarray(points).ravel()
    return replace(cloud, height=1, width=len(points), row_step=len(data), data=data)


def read(path, thin):
    """(topic, type, time, message) of every message."""
    with Reader(path) as reader:
        for c, time, raw in reader.messages():
            message = ros1.STORE.deserialize_ros1(raw, c.msgtype)
            if thin > 1 and c.msgtype.endswith("PointCloud2"):
                message = thinned(message, thin)
            yield c.topic, c.msgtype, time, message


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("bag", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--thin", type=int, default=1)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    messages = list(read(args.bag, args.thin))
    if args.thin > 1:
        path = args.out / "drive.bag"
        path.unlink(missing_ok=True)
        writer = Ros1Writer(path)
        writer.set_compression(Ros1Writer.CompressionFormat.BZ2)
        with writer:
            connections = {}
            for topic, kind, time, message in messages:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=ros1.STORE)
                writer.write(connections[topic], time, ros1.STORE.serialize_ros1(message, kind))
    recorded = [
        (topic, kind, time, bytes(ros2.STORE.serialize_cdr(ros2.ros2(message), kind)))
        for topic, kind, time, message in messages
    ]
    ros2.HERE = args.out
    ros2.by_rosbags("sqlite", recorded, StoragePlugin.SQLITE3, compress=args.thin > 1)
    if args.thin <= 1:
        ros2.by_rosbags("mcap", recorded, StoragePlugin.MCAP)
    ros2.by_mcap("zstd.mcap", recorded, CompressionType.ZSTD)
    shutil.copyfile(args.bag.with_suffix(".toml"), args.out / "bag.toml")
    for path in sorted(args.out.rglob("*.*")):
        print(path.relative_to(args.out), path.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
