"""Bags of ROS 2 and their values for the tests, by PyPI's `rosbags` and `mcap`: other implementations of the formats.

pip install rosbags numpy mcap lz4 zstandard
python crates/deepfusion-ros2bag/tests/reference/ros2_reference.py [FOLDER WITH REAL BAGS]

Writes beside itself the messages of `deepfusion-rosbag`'s reference (every type, times that go back and forth), every
other one of a topic big-endian:
- sqlite/, sqlite_packed/ (each message compressed), mcap/, mcap_packed/: as rosbags records them, with metadata.yaml
- none.mcap, lz4.mcap, zstd.mcap: many small chunks; bare.mcap: neither chunks nor a summary
- every_type.json: what rosbags reads from them, all values
and, with the folder of real bags, real_bags.json (every topic's digest, values of the types that are known).
"""
import json
import shutil
import sys
from io import BytesIO
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2] / "deepfusion-rosbag/tests/reference"))
import rosbags_reference as ros1  # noqa: E402
from mcap.writer import CompressionType, IndexType, Writer as McapWriter  # noqa: E402
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: E402


def typestore():
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = {}
    for name, text in ros1.EXTRA.items():
        types.update(get_types_from_msg(text, name))
    store.register(types)
    return store


STORE = typestore()


def ros2(value):
    """A message of ROS 1 as that of ROS 2: without sequence numbers, CameraInfo's matrices in small letters."""
    kind = getattr(type(value), "__msgtype__", None)
    if isinstance(value, list):
        return [ros2(v) for v in value]
    if kind is None:
        return value
    make = STORE.types[kind]
    names = [f for f in make.__dataclass_fields__ if not hasattr(make, f)]
    old = {f.lower(): f for f in value.__dataclass_fields__}
    return make(*(ros2(getattr(value, old[n])) for n in names))


def lines(value):
    """As the Rust tests name the fields."""
    names = {"d": "D", "k": "K", "r": "R", "p": "P"}
    out = []
    for line in ros1.flatten(value):
        field, text = line.split(" = ", 1)
        head = field.split("[")[0]
        if type(value).__name__.endswith("CameraInfo") and head in names:
            field = names[head] + field[len(head) :]
        out.append(f"{field} = {text}")
    return out


def serialised():
    """(topic, type, time, bytes) of every message."""
    seen, out = {}, []
    for topic, _, kind, time, message, _ in ros1.messages():
        little = seen.setdefault(topic, 0) % 2 == 0
        seen[topic] += 1
        data = bytes(STORE.serialize_cdr(ros2(message), kind, little_endian=little))
        out.append((topic, kind, time, data))
    return out


def by_rosbags(name, recorded, plugin, compress=False):
    path = HERE / name
    shutil.rmtree(path, ignore_errors=True)
    writer = Writer(path, version=9, storage_plugin=plugin)
    if compress:
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, kind, time, data in recorded:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], time, data)
    return path


def by_mcap(name, recorded, compression, bare=False):
    out = BytesIO()
    nothing = {"use_chunking": False, "index_types": IndexType.NONE, "use_statistics": False, "repeat_channels": False,
               "repeat_schemas": False, "use_summary_offsets": False} if bare else {}  # fmt: skip
    writer = McapWriter(out, chunk_size=3000, compression=compression, **nothing)
    writer.start(profile="ros2")
    channels = {}
    for i, (topic, kind, time, data) in enumerate(recorded):
        if topic not in channels:
            text, _ = STORE.generate_msgdef(kind, ros_version=2)
            schema = writer.register_schema(kind, "ros2msg", text.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        writer.add_message(channels[topic], log_time=time, data=data, publish_time=time, sequence=i)
    writer.finish()
    path = HERE / name
    path.write_bytes(out.getvalue())
    return path


def describe(path):
    with Reader(path) as reader:
        messages = [
            {
                "topic": c.topic, "type": ros1.ros1(c.msgtype), "time": time, "sha256": ros1.sha(raw),
                "values": lines(STORE.deserialize_cdr(raw, c.msgtype)) if c.msgtype in ros1.TYPES else [],
            }
            for c, time, raw in reader.messages()
        ]  # fmt: skip
    return {"messages": messages}


def main():
    recorded = serialised()
    folders = [
        by_rosbags("sqlite", recorded, StoragePlugin.SQLITE3),
        by_rosbags("sqlite_packed", recorded, StoragePlugin.SQLITE3, compress=True),
        by_rosbags("mcap", recorded, StoragePlugin.MCAP),
        by_rosbags("mcap_packed", recorded, StoragePlugin.MCAP, compress=True),
    ]
    files = [
        by_mcap("none.mcap", recorded, CompressionType.NONE),
        by_mcap("lz4.mcap", recorded, CompressionType.LZ4),
        by_mcap("zstd.mcap", recorded, CompressionType.ZSTD),
        by_mcap("bare.mcap", recorded, CompressionType.NONE, bare=True),
    ]
    results = [describe(path) for path in folders]
    key = lambda m: (m["time"], m["topic"])
    for result in results:
        result["messages"].sort(key=key)
    assert results[0] == results[1] == results[2] == results[3]
    ros1.HERE = HERE
    ros1.save("every_type.json", results[0])
    for path in [*files, *(f for folder in folders for f in folder.iterdir())]:
        print(path.relative_to(HERE), path.stat().st_size, "bytes")
    if len(sys.argv) > 1:
        ros1.save("real_bags.json", real(Path(sys.argv[1])))


def real(folder):
    bags = {}
    for path in sorted((folder / "rosbags_rs_ros2_all_msgs").iterdir()):
        with Reader(path) as reader:
            topics = {}
            for c, time, raw in reader.messages():
                known = c.msgtype in ros1.TYPES
                topic = topics.setdefault(c.topic, {"type": ros1.ros1(c.msgtype), "messages": [], "values": []})
                topic["messages"].append(f"{time} {ros1.sha(raw)}\n")
                topic["values"] += lines(STORE.deserialize_cdr(raw, c.msgtype)) if known else []
            for topic in topics.values():
                count, digest = len(topic["messages"]), ros1.sha("".join(topic.pop("messages")).encode())
                topic |= {"count": count, "digest": digest}
            bags[path.name] = topics
    return bags


if __name__ == "__main__":
    main()
