"""The other direction: PyPI's `rosbags` reads the bags that the Rust writer writes.

pip install rosbags numpy
python crates/deepfusion-rosbag/tests/reference/check_written.py

Has the test `written_bags` write its bags and their values, reads them with rosbags' AnyReader (types by the definitions
in the bag, whose MD5 it checks), compares topics, times and every value, and puts the SHA-256 of the bags into
written.json: that is what the test compares its bytes with from then on.
"""
import json
import os
import subprocess
import tempfile
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Reader

from rosbags_reference import HERE, flatten, save, sha

PACKAGE = ["cargo", "test", "-p", "deepfusion-rosbag", "--test", "written_bags"]


def check(bag):
    written = json.loads(bag.with_suffix(".json").read_text())
    expected = sorted(written, key=lambda m: m["time"])
    with AnyReader([bag]) as reader:
        found = [
            {"topic": c.topic, "time": time, "values": flatten(reader.deserialize(raw, c.msgtype))}
            for c, time, raw in reader.messages()
        ]
        assert len(reader.connections) == 14, reader.connections
    assert len(found) == len(expected) == 104, (len(found), len(expected))
    for a, b in zip(found, expected):
        assert a == b, (a, b)
    with Reader(bag) as reader:
        chunks, values = len(reader.chunk_infos), sum(len(m["values"]) for m in found)
    print(f"{bag.name}: {len(found)} messages, {values} values, {chunks} chunks: all equal")
    return sha(bag.read_bytes())


def main():
    if not (HERE / "written.json").exists():
        (HERE / "written.json").write_text("{}\n")
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(PACKAGE, check=True, cwd=HERE, env=os.environ | {"DEEPFUSION_WRITE_BAGS": folder})
        bags = sorted(Path(folder).glob("*.bag"))
        assert len(bags) == 3
        save("written.json", {bag.name: check(bag) for bag in bags})


if __name__ == "__main__":
    main()
