"""Messages of video streams, for the tests, by PyPI's `rosbags`: another implementation.

pip install rosbags numpy
python crates/deepfusion-rosbag/tests/reference/video_reference.py

Writes video.json beside itself, as frames_reference.py does frames.json. The definitions are those of the packages, without
comments: foxglove_msgs (ROS 1 and 2), ffmpeg_image_transport_msgs as released for ROS 2, and its first version for ROS 1, which
has the same name and other fields.
"""
import numpy as np
import rosbags_reference as ros1
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

VIDEO, PACKET = "foxglove_msgs/msg/CompressedVideo", "ffmpeg_image_transport_msgs/msg/FFMPEGPacket"
DEFINITIONS = {
    "video": (VIDEO, "time timestamp\nstring frame_id\nuint8[] data\nstring format\n"),
    "packet": (
        PACKET,
        "std_msgs/Header header\nint32 width\nint32 height\nstring encoding\nuint64 pts\nuint8 flags\nbool is_bigendian\nuint8[] data\n",
    ),
    "old_packet": (
        PACKET,
        "Header header\nuint8[] data\nint32 img_width\nint32 img_height\nstring encoding\nuint64 pts\nuint8 flags\n",
    ),
}


def store(which, name):
    kind, text = DEFINITIONS[name]
    if which is not Stores.ROS1_NOETIC:
        text = text.replace("time timestamp", "builtin_interfaces/Time timestamp")
    found = get_typestore(which)
    found.register(get_types_from_msg(text, kind))
    return found


def value(types, name, header, time):
    data = np.arange(7, dtype=np.uint8)
    make = types[DEFINITIONS[name][0]]
    if name == "video":
        return make(time(1_700_000_001, 23), "camera", data, "h264")
    if name == "packet":
        return make(header, 640, 480, "h264;yuv420p;bgr8", (1 << 40) + 3, 1, False, data)
    return make(header, data, 640, -480, "libx264", (1 << 40) + 3, 1)


def main():
    out = {}
    for name, (kind, _) in DEFINITIONS.items():
        one = store(Stores.ROS1_NOETIC, name)
        message = value(one.types, name, ros1.header(4, "camera"), one.types["builtin_interfaces/msg/Time"])
        definition, md5 = one.generate_msgdef(kind)
        bytes_of = {"ros1": one.serialize_ros1(message, kind)}
        values = ros1.flatten(one.deserialize_ros1(bytes_of["ros1"], kind))
        values_ros2 = []
        if name != "old_packet":
            two = store(Stores.ROS2_HUMBLE, name)
            time = two.types["builtin_interfaces/msg/Time"]
            header = two.types["std_msgs/msg/Header"](time(1_700_000_001, 23), "camera")
            message = value(two.types, name, header, time)
            for key, little in [("cdr", True), ("cdr_big", False)]:
                bytes_of[key] = two.serialize_cdr(message, kind, little_endian=little)
            values_ros2 = ros1.flatten(two.deserialize_cdr(bytes_of["cdr_big"], kind))
        out[name] = {
            "md5": md5, "definition": definition, **{key: bytes(b).hex() for key, b in bytes_of.items()},
            "values": values, "values_ros2": values_ros2,
        }  # fmt: skip
    ros1.save("video.json", out)


if __name__ == "__main__":
    main()
