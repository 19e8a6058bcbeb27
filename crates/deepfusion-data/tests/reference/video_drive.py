"""A bag of ROS 2 whose camera is a video stream, as messages of two kinds, by PyPI's `rosbags` and ffmpeg with libx264.

pip install rosbags numpy
python crates/deepfusion-data/tests/reference/video_drive.py

Writes video_ros2/ beside itself (MCAP): twelve pictures of 64×48 at 10 Hz, a flat colour each (red 20 n, green 120, blue 200 - 20 n for
the nth), on /front/video (foxglove_msgs/CompressedVideo, as Annex B) and /rear/image_raw/ffmpeg
(ffmpeg_image_transport_msgs/FFMPEGPacket), CameraInfo of both, another of each, and 10 m/s. The stamps are 2 ms before the
time of recording.
"""
import shutil
import subprocess
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

OUT = Path(__file__).parent / "video_ros2"
VIDEO, PACKET = "foxglove_msgs/msg/CompressedVideo", "ffmpeg_image_transport_msgs/msg/FFMPEGPacket"
FRAMES, WIDTH, HEIGHT = 12, 64, 48

ROS2 = get_typestore(Stores.ROS2_HUMBLE)
ROS2.register({
    **get_types_from_msg("builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n", VIDEO),
    **get_types_from_msg(
        "std_msgs/Header header\nint32 width\nint32 height\nstring encoding\nuint64 pts\nuint8 flags\nbool is_bigendian\nuint8[] data\n",
        PACKET,
    ),
})  # fmt: skip
TYPES = ROS2.types


def packets():
    """One packet per picture, split at the unit that x264 puts before each."""
    raw = b"".join(bytes((20 * n, 120, max(200 - 20 * n, 0))) * (WIDTH * HEIGHT) for n in range(FRAMES))
    command = (
        f"ffmpeg -v error -f rawvideo -pix_fmt rgb24 -s {WIDTH}x{HEIGHT} -r 10 -i - -pix_fmt yuv420p -c:v libx264 -qp 8 -bf 0 -g 5 "
        "-x264-params aud=1 -f h264 -"
    )
    stream = subprocess.run(command.split(), input=raw, stdout=subprocess.PIPE, check=True).stdout
    mark = b"\0\0\0\1\x09"
    found = [mark + part for part in stream.split(mark)[1:]]
    assert len(found) == FRAMES
    return found


def info(header, focal):
    roi = TYPES["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    k = np.array([focal, 0, 31.5, 0, focal, 23.5, 0, 0, 1.0])
    p = np.array([focal, 0, 31.5, 0, 0, focal, 23.5, 0, 0, 0, 1.0, 0])
    return TYPES["sensor_msgs/msg/CameraInfo"](
        header, HEIGHT, WIDTH, "plumb_bob", np.zeros(5), k, np.eye(3).ravel(), p, 0, 0, roi
    )


def main():
    shutil.rmtree(OUT, ignore_errors=True)
    vector = TYPES["geometry_msgs/msg/Vector3"]
    twist = TYPES["geometry_msgs/msg/Twist"](vector(10.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    with Writer(OUT, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}

        def write(topic, time, message):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS2)
            writer.write(connections[topic], time, bytes(ROS2.serialize_cdr(message, kind)))

        for n, packet in enumerate(packets()):
            taken = 1_700_000_000_000_000_000 + n * 100_000_000
            time, data = taken + 2_000_000, np.frombuffer(packet, np.uint8)
            stamp = TYPES["builtin_interfaces/msg/Time"](taken // 10**9, taken % 10**9)
            header = TYPES["std_msgs/msg/Header"](stamp, "camera")
            write("/front/camera_info", time, info(header, 60.0))
            write("/front/video", time, TYPES[VIDEO](stamp, "camera", data, "h264"))
            write("/rear/camera_info", time, info(header, 50.0))
            rear = TYPES[PACKET](header, WIDTH, HEIGHT, "h264;yuv420p;rgb8;rgb8", n, int(n % 5 == 0), False, data)
            write("/rear/image_raw/ffmpeg", time, rear)
            write("/speed", time, TYPES["geometry_msgs/msg/TwistStamped"](header, twist))


if __name__ == "__main__":
    main()
