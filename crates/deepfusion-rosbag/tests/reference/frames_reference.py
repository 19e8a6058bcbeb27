"""Messages of frames and of a velocity with a covariance, for the tests, by PyPI's `rosbags`: another implementation.

pip install rosbags numpy
python crates/deepfusion-rosbag/tests/reference/frames_reference.py

Writes frames.json beside itself: for each type its MD5 and definition, the bytes of a message as ROS 1 and as ROS 2 (CDR of
both byte orders) have them, in hexadecimal digits, and its values as `rosbags_reference.py` writes them.
"""
import rosbags_reference as ros1
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TF = "geometry_msgs/TransformStamped[] transforms\n"
KINDS = ["tf2_msgs/msg/TFMessage", "tf/msg/tfMessage", "geometry_msgs/msg/TwistWithCovarianceStamped"]


def store(which):
    found = get_typestore(which)
    types = {}
    for kind in KINDS[:2]:
        if kind not in found.types:
            types.update(get_types_from_msg(TF, kind))
    found.register(types)
    return found


ROS1, ROS2 = store(Stores.ROS1_NOETIC), store(Stores.ROS2_HUMBLE)


def frames(kind):
    make = ROS1.types
    out = []
    for i, (parent, child) in enumerate([("base_link", "mast"), ("mast", "camera_optical – left"), ("", "x")]):
        transform = make["geometry_msgs/msg/Transform"](ros1.vector3(), ros1.quaternion())
        header = ros1.header(i, parent)
        out.append(make["geometry_msgs/msg/TransformStamped"](header, child, transform))
    return make[kind](out)


def message(kind):
    if kind in KINDS[:2]:
        return frames(kind)
    speed = ROS1.types["geometry_msgs/msg/TwistWithCovariance"](ros1.twist(), ros1.RNG.normal(size=36))
    return ROS1.types[kind](ros1.header(2, "base_link"), speed)


def as_ros2(value):
    """Without sequence numbers."""
    if isinstance(value, list):
        return [as_ros2(v) for v in value]
    kind = getattr(type(value), "__msgtype__", None)
    if kind is None:
        return value
    make = ROS2.types[kind]
    names = [f for f in make.__dataclass_fields__ if not hasattr(make, f)]
    return make(*(as_ros2(getattr(value, n)) for n in names))


def main():
    types = {}
    for kind in KINDS:
        definition, md5 = ROS1.generate_msgdef(kind)
        value = message(kind)
        bytes_of = {"ros1": ROS1.serialize_ros1(value, kind)}
        for name, little in [("cdr", True), ("cdr_big", False)]:
            bytes_of[name] = ROS2.serialize_cdr(as_ros2(value), kind, little_endian=little)
        # The values that it reads from its own bytes.
        read = ROS1.deserialize_ros1(bytes_of["ros1"], kind)
        read2 = ROS2.deserialize_cdr(bytes_of["cdr_big"], kind)
        types[ros1.ros1(kind)] = {
            "md5": md5, "definition": definition, **{name: bytes(b).hex() for name, b in bytes_of.items()},
            "values": ros1.flatten(read), "values_ros2": ros1.flatten(read2),
        }  # fmt: skip
    ros1.save("frames.json", types)


if __name__ == "__main__":
    main()
