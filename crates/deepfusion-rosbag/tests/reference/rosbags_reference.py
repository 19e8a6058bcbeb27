"""Bags and values for the tests, by PyPI's `rosbags`: another implementation of the same format.

pip install rosbags numpy
python crates/deepfusion-rosbag/tests/reference/rosbags_reference.py [FOLDER WITH REAL BAGS]

Writes beside itself: every_type_{none,lz4,bz2}.bag (every message type, in many small chunks whose times overlap, two
publishers of one topic), linked_lz4.bag (a chunk of several LZ4 blocks), every_type.json (what rosbags reads from them, all values), and, with the folder of real bags
(`../shared/data/rosbag`), real_bags.json (counts, times, first and last values, a digest over all messages).

A value is a line `field = text`; floats are the 16 hexadecimal digits of their f64, bytes and longer arrays of floats
(big-endian f64) are their SHA-256.
"""
import hashlib
import json
import struct
import sys
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

HERE = Path(__file__).parent
HEADER = "std_msgs/Header header\n"
# Not in rosbags' own store: the field lists of the ROS packages ackermann_msgs and can_msgs.
EXTRA = {
    "ackermann_msgs/msg/AckermannDrive": "float32 steering_angle\nfloat32 steering_angle_velocity\n"
    "float32 speed\nfloat32 acceleration\nfloat32 jerk\n",
    "ackermann_msgs/msg/AckermannDriveStamped": HEADER + "ackermann_msgs/AckermannDrive drive\n",
    "can_msgs/msg/Frame": HEADER
    + "uint32 id\nbool is_rtr\nbool is_extended\nbool is_error\nuint8 dlc\nuint8[8] data\n",
}
TYPES = [
    "std_msgs/msg/Float32", "std_msgs/msg/Float64", "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage",
    "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix",
    "geometry_msgs/msg/TwistStamped", "nav_msgs/msg/Odometry", "ackermann_msgs/msg/AckermannDriveStamped",
    "can_msgs/msg/Frame",
]  # fmt: skip


def typestore():
    store = get_typestore(Stores.ROS1_NOETIC)
    types = {}
    for name, text in EXTRA.items():
        types.update(get_types_from_msg(text, name))
    store.register(types)
    return store


STORE = typestore()
T = STORE.types


def sha(data):
    return hashlib.sha256(bytes(data)).hexdigest()


def number(value):
    return struct.pack(">d", float(value)).hex()


def flatten(value, name=""):
    """A message as lines `field = text`."""
    dot = f"{name}." if name else ""
    if isinstance(value, np.ndarray):
        if value.dtype == np.uint8:
            return [f"{name} = {sha(value)}"]
        if len(value) > 4:
            return [f"{name} = {sha(value.astype('>f8').tobytes())}"]
        return [f"{name}[{i}] = {number(v)}" for i, v in enumerate(value)]
    if isinstance(value, list):
        return [line for i, v in enumerate(value) for line in flatten(v, f"{name}[{i}]")]
    if isinstance(value, (bool, np.bool_)):
        return [f"{name} = {str(bool(value)).lower()}"]
    if isinstance(value, (int, np.integer)):
        return [f"{name} = {int(value)}"]
    if isinstance(value, (float, np.floating)):
        return [f"{name} = {number(value)}"]
    if isinstance(value, str):
        return [f"{name} = {value}"]
    if type(value).__name__.endswith("Time"):
        return [f"{name} = {value.sec}.{value.nanosec:09}"]
    # A type's constants, and its name, are fields that have a value in the class itself.
    fields = [f for f in value.__dataclass_fields__ if not hasattr(type(value), f)]
    return [line for f in fields for line in flatten(getattr(value, f), f"{dot}{f}")]


# --- the messages ---

RNG = np.random.default_rng(2024)


def header(i, frame):
    time = T["builtin_interfaces/msg/Time"](sec=1_700_000_000 + i, nanosec=(123_456_789 * (i + 1)) % 10**9)
    return T["std_msgs/msg/Header"](seq=i, stamp=time, frame_id=frame)


def vector3():
    return T["geometry_msgs/msg/Vector3"](*RNG.normal(size=3).tolist())


def quaternion():
    q = RNG.normal(size=4)
    return T["geometry_msgs/msg/Quaternion"](*(q / np.linalg.norm(q)).tolist())


def twist():
    return T["geometry_msgs/msg/Twist"](vector3(), vector3())


def odd_cloud(i):
    """Big-endian on odd i; fields neither in order nor adjacent, every datatype, padded rows, counts of 0, 1 and 2."""
    e = ">" if i % 2 else "<"
    layout = [
        ("velocity", 17, "f4", 1), ("x", 1, "f4", 0), ("line", 5, "u1", 1), ("z", 13, "f4", 1), ("y", 9, "f4", 1),
        ("t", 22, "f8", 2), ("ring", 40, "u2", 1), ("level", 42, "i2", 1), ("id", 44, "u4", 1), ("offset", 48, "i4", 1),
        ("sign", 39, "i1", 1),
    ]  # fmt: skip
    codes = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
    height, width, step, row = 2, 3, 53, 53 * 3 + 7
    dtype = np.dtype({
        "names": [n for n, *_ in layout],
        "offsets": [o for _, o, *_ in layout],
        "formats": [(e + k, max(c, 1)) if c == 2 else e + k for _, _, k, c in layout],
        "itemsize": step,
    })  # fmt: skip
    data = bytearray(RNG.integers(0, 256, height * row, dtype=np.uint8).tobytes())
    columns = {name: [] for name, *_ in layout} | {"t/1": []}
    for r in range(height):
        points = np.frombuffer(data, dtype, count=width, offset=r * row)
        for name, _, kind, count in layout:
            if kind[0] == "f":  # random bits make NaNs, which have many spellings
                points[name] = RNG.normal(size=(width, 2) if count == 2 else width) * 50
            else:
                info = np.iinfo(kind)
                points[name] = RNG.integers(info.min, info.max, size=width, endpoint=True)
            numbers = points[name] if count < 2 else points[name][:, 0]
            columns[name] += [number(v) for v in numbers]
        columns["t/1"] += [number(v) for v in points["t"][:, 1]]
    fields = [T["sensor_msgs/msg/PointField"](n, o, codes[k], c) for n, o, k, c in layout]
    message = T["sensor_msgs/msg/PointCloud2"](
        header(i, "lidar"), height, width, fields, e == ">", step, row, np.frombuffer(bytes(data), np.uint8), False
    )
    return message, {"columns": columns}


def image(i):
    """Four encodings in turn, rows padded, 16-bit pixels big-endian."""
    encoding = ["bgr8", "16UC1", "rgba8", "bayer_rggb8"][i % 4]
    height, width = 5, 7
    if encoding == "16UC1":
        big = True
        pixels = RNG.integers(0, 2**16, (height, width), dtype=np.uint16)
        rows = pixels.astype(">u2").tobytes()
        expected = {"u16": pixels.ravel().tolist()}
    else:
        big = False
        channels = {"bgr8": 3, "rgba8": 4, "bayer_rggb8": 1}[encoding]
        pixels = RNG.integers(0, 256, (height, width, channels), dtype=np.uint8)
        rows = pixels.tobytes()
        order = {"bgr8": [2, 1, 0], "rgba8": [0, 1, 2]}.get(encoding)
        expected = {"rgb8": sha(np.ascontiguousarray(pixels[..., order]))} if order else {}
    row = len(rows) // height
    padded = b"".join(rows[y * row : (y + 1) * row] + b"\xee" * 3 for y in range(height))
    data = np.frombuffer(padded, np.uint8)
    return T["sensor_msgs/msg/Image"](header(i, "camera"), height, width, encoding, int(big), row + 3, data), expected


def message(kind, i):
    """Message i of a type, and what else is known of it."""
    f8 = lambda n: RNG.normal(size=n)
    make = T[kind]
    match kind.split("/")[-1]:
        case "Float32":
            return make(float(np.float32(RNG.normal()))), {}
        case "Float64":
            return make(float(RNG.normal())), {}
        case "Image":
            return image(i)
        case "CompressedImage":
            return make(header(i, "camera"), "jpeg", RNG.integers(0, 256, 50 + i, dtype=np.uint8)), {}
        case "CameraInfo":
            roi = T["sensor_msgs/msg/RegionOfInterest"](1, 2, 300, 400 + i, bool(i % 2))
            return make(header(i, "camera"), 480, 640, "plumb_bob", f8(i), f8(9), f8(9), f8(12), 2, 0, roi), {}
        case "PointCloud2":
            return odd_cloud(i)
        case "Imu":
            return make(header(i, "imu"), quaternion(), f8(9), vector3(), f8(9), vector3(), f8(9)), {}
        case "NavSatFix":
            status = T["sensor_msgs/msg/NavSatStatus"](i - 1, 9)
            altitude = float("nan") if i == 0 else float(RNG.normal())
            return make(header(i, "gps"), status, 49.01 + i, 8.43, altitude, f8(9), 2), {}
        case "TwistStamped":
            return make(header(i, "base_link – vehicle"), twist()), {}
        case "Odometry":
            pose = T["geometry_msgs/msg/Pose"](T["geometry_msgs/msg/Point"](*f8(3).tolist()), quaternion())
            pose = T["geometry_msgs/msg/PoseWithCovariance"](pose, f8(36))
            speed = T["geometry_msgs/msg/TwistWithCovariance"](twist(), f8(36))
            return make(header(i, "odom"), "base_link", pose, speed), {}
        case "AckermannDriveStamped":
            drive = T["ackermann_msgs/msg/AckermannDrive"](*RNG.normal(size=5).astype(np.float32).tolist())
            return make(header(i, ""), drive), {}
        case "Frame":
            data = RNG.integers(0, 256, 8, dtype=np.uint8)
            return make(header(i, "can0"), 0x1ABCDEF0 + i, False, True, bool(i % 2), 8, data), {}


def messages():
    """(topic, publisher, type, time, message, more); times go back and forth, so that chunks overlap."""
    out = []
    for i in range(4):
        for k, kind in enumerate(TYPES):
            # Within 10 s; no two alike, so that the order is one and the same for every reader.
            time = 1_700_000_000_000_000_000 + i * 1_500_000_000 + (k * 7919 % 12) * 400_000_000 + k
            publisher = f"/node_{i % 2}" if kind.endswith("Imu") else None
            out.append((f"/topic/{kind.split('/')[-1].lower()}", publisher, kind, time, *message(kind, i)))
    return out


def write(path, recorded, compression):
    path.unlink(missing_ok=True)
    writer = Writer(path)
    if compression:
        writer.set_compression(compression)
    writer.chunk_threshold = 3000
    with writer:
        connections = {}
        for topic, publisher, kind, time, msg, _ in recorded:
            key = (topic, publisher)
            if key not in connections:
                latching = 1 if publisher == "/node_1" else None
                connections[key] = writer.add_connection(
                    topic, kind, typestore=STORE, callerid=publisher, latching=latching
                )
            writer.write(connections[key], time, STORE.serialize_ros1(msg, kind))


def ros1(kind):
    return kind.replace("/msg/", "/")


def describe(reader):
    connections = [
        {
            "topic": c.topic, "type": ros1(c.msgtype), "md5": c.digest, "count": c.msgcount,
            "caller_id": c.ext.callerid, "latching": bool(c.ext.latching),
        }
        for c in reader.connections
    ]  # fmt: skip
    # rosbags' end is a nanosecond after the last message.
    return {"connections": connections, "first": reader.start_time, "last": reader.end_time - 1}


def select(reader, topics, start, stop):
    chosen = [c for c in reader.connections if c.topic in topics]
    found = [[c.topic, t] for c, t, _ in reader.messages(chosen, start, stop)]
    return {"topics": topics, "from": start, "until": stop, "messages": found}


def every_type():
    recorded = messages()
    extra = {(topic, time): more for topic, _, _, time, _, more in recorded}
    results = []
    for name, compression in [("none", None), ("lz4", Writer.CompressionFormat.LZ4), ("bz2", Writer.CompressionFormat.BZ2)]:
        path = HERE / f"every_type_{name}.bag"
        write(path, recorded, compression)
        with Reader(path) as reader:
            result = describe(reader)
            result["messages"] = [
                {
                    "topic": c.topic, "type": ros1(c.msgtype), "time": time, "sha256": sha(raw),
                    "values": flatten(STORE.deserialize_ros1(raw, c.msgtype)), **extra[(c.topic, time)],
                }
                for c, time, raw in reader.messages()
            ]  # fmt: skip
            first, middle = result["first"], (result["first"] + result["last"]) // 2
            result["selections"] = [
                select(reader, ["/topic/imu"], None, None),
                select(reader, ["/topic/imu", "/topic/frame"], first + 2_000_000_000, middle),
                select(reader, ["/topic/odometry"], middle, middle + 1),
                select(reader, [c.topic for c in reader.connections], middle, None),
                select(reader, ["/topic/float64"], None, result["messages"][9]["time"]),
            ]
            overlaps = sum(a.end_time > b.start_time for a, b in zip(reader.chunk_infos, reader.chunk_infos[1:]))
            print(path.name, path.stat().st_size, "bytes", len(reader.chunk_infos), "chunks", overlaps, "overlap")
        results.append(result)
    assert results[0] == results[1] == results[2]
    types = {}
    for kind in TYPES:
        definition, md5 = STORE.generate_msgdef(kind)
        types[ros1(kind)] = {"md5": md5, "definition": definition}
    results[0]["types"] = types
    save("every_type.json", results[0])


def linked_blocks():
    """A chunk of several LZ4 blocks, each referring to the one before: liblz4's default, and not that of ROS."""
    tile = RNG.integers(0, 256, 999, dtype=np.uint8)
    data = np.tile(tile, 400)
    picture = T["sensor_msgs/msg/CompressedImage"](header(0, "camera"), "none", data)
    recorded = [("/camera", None, "sensor_msgs/msg/CompressedImage", 5, picture, {})]
    write(HERE / "linked_lz4.bag", recorded, Writer.CompressionFormat.LZ4)
    save("linked_lz4.json", {"bytes": len(data), "sha256": sha(data)})


def real(folder):
    bags = {}
    for path in sorted(folder.glob("*.bag")):
        with Reader(path) as reader:
            bag, lines = describe(reader), []
            bag["topics"] = {}
            for c, time, raw in reader.messages():
                lines.append(f"{time} {c.topic} {sha(raw)}\n")
                topic = bag["topics"].setdefault(c.topic, {"type": ros1(c.msgtype), "count": 0, "first": None})
                topic["count"] += 1
                if c.msgtype in TYPES:
                    values = {"time": time, "values": flatten(STORE.deserialize_ros1(raw, c.msgtype))}
                else:
                    values = {"time": time, "values": []}
                topic["first"] = topic["first"] or values
                topic["last"] = values
            # Messages of one time have no order of their own: sorted by time, topic and content.
            bag["digest"] = sha("".join(sorted(lines)).encode())
            bags[path.name] = bag
    save("real_bags.json", bags)


def save(name, value):
    (HERE / name).write_text(json.dumps(value, indent=None, separators=(",", ":"), ensure_ascii=False) + "\n")
    print(name, (HERE / name).stat().st_size, "bytes")


if __name__ == "__main__":
    every_type()
    linked_blocks()
    if len(sys.argv) > 1:
        real(Path(sys.argv[1]))
