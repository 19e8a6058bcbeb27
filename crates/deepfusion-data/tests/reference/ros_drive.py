"""A drive as a ROS vehicle records it, for the tests, by PyPI's `rosbags`: frames on /tf_static and /tf, CameraInfo, satellite positions
at 1 Hz, no file beside it.

pip install rosbags numpy scipy pymap3d pillow
deepfusion simulate --out drive --format bag --scene urban --frames 251 --size 96x64 --moving-cars 1 --seed 11
python crates/deepfusion-data/tests/reference/ros_drive.py drive/urban_0011.bag

Writes beside itself ros/drive.bag (ROS 1), ros/drive_ros2/ (ROS 2, MCAP) and ros/drive.json: what is known of the drive, which the readers are
to find. Of the simulated bag come the images (every fifth, as JPEG), every hundredth point of a scan a second, the inertial unit at 25 Hz and the
vehicle's exact path. Of the path come the positions: WGS 84 by pymap3d, in one second of ten without a fix. The places of the sensors are those of the
simulator's file beside the bag, cut into chains of frames, some of them turned by arbitrary rotations (scipy): no chain is a transform of that file.
"""
import io
import json
import shutil
import sys
import tomllib
from pathlib import Path

import numpy as np
import pymap3d
from PIL import Image
from rosbags.rosbag1 import Reader, Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

OUT = Path(__file__).parent / "ros"
ORIGIN = (49.0123, 8.4321, 117.0)  # degrees to the north and to the east, metres
TF = "tf2_msgs/msg/TFMessage"
FIX = "sensor_msgs/msg/NavSatFix"


def store(which):
    found = get_typestore(which)
    types = get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", TF)
    found.register({name: fields for name, fields in types.items() if name not in found.types})
    return found


ROS1, ROS2 = store(Stores.ROS1_NOETIC), store(Stores.ROS2_HUMBLE)
T = ROS1.types


def matrix(rotation, translation):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation.as_matrix(), translation
    return out


def of_file(entry):
    return matrix(Rotation.from_rotvec(entry["rotation"]), entry["translation"])


def header(ns, frame):
    time = T["builtin_interfaces/msg/Time"](sec=int(ns // 10**9), nanosec=int(ns % 10**9))
    return T["std_msgs/msg/Header"](seq=0, stamp=time, frame_id=frame)


def transform(ns, parent, child, parent_from_child):
    q = Rotation.from_matrix(parent_from_child[:3, :3]).as_quat()
    place = T["geometry_msgs/msg/Vector3"](*map(float, parent_from_child[:3, 3]))
    turned = T["geometry_msgs/msg/Quaternion"](*map(float, q))
    of = T["geometry_msgs/msg/Transform"](place, turned)
    return T["geometry_msgs/msg/TransformStamped"](header(ns, parent), child, of)


def chain(names, parent_from_last):
    """Links along a chain of frames whose product is a given transform; the frames in between are arbitrary."""
    rng = np.random.default_rng(len(names))
    links, so_far = [], np.eye(4)
    for parent, child in zip(names, names[1:]):
        if child == names[-1]:
            link = np.linalg.inv(so_far) @ parent_from_last
        else:
            link = matrix(Rotation.from_rotvec(rng.normal(size=3)), rng.normal(size=3))
        so_far = so_far @ link
        links.append((parent, child, link))
    return links


def ns_of(stamp):
    return stamp.sec * 10**9 + stamp.nanosec


def main(path):
    beside = tomllib.loads(path.with_suffix(".toml").read_text())
    vehicle_from_cam = np.linalg.inv(of_file(beside["cam_from_vehicle"]))
    cam_from_lidar = of_file(beside["cam_from_lidar"])
    vehicle_from_imu = of_file(beside["vehicle_from_imu"])
    static = (
        chain(["base_link", "roof_rack", "camera_front_link", "camera_front_optical"], vehicle_from_cam)
        + chain(["roof_rack", "lidar_mount", "lidar_top"], np.eye(4))
        + chain(["base_link", "imu_link"], vehicle_from_imu)
        + chain(["base_footprint", "base_link"], matrix(Rotation.identity(), [0, 0, 0.31]))
    )
    # The LiDAR hangs from the same rack as the camera: its last link closes the loop.
    rack = static[0][2]
    mount = next(link for _, child, link in static if child == "lidar_mount")
    static = [
        (p, c, np.linalg.inv(rack @ mount) @ vehicle_from_cam @ cam_from_lidar if c == "lidar_top" else link)
        for p, c, link in static
    ]
    recorded = []  # topic, type, time, message
    poses = []
    start = None
    counts = {}
    with Reader(path) as reader:
        for connection, time, raw in reader.messages():
            kind, topic = connection.msgtype, connection.topic
            n = counts[topic] = counts.get(topic, -1) + 1
            start = start or time
            if kind not in ROS1.types:
                continue
            message = ROS1.deserialize_ros1(raw, kind)
            if topic == "/camera/image_rect/compressed" and n % 5 == 0:
                out = io.BytesIO()
                Image.open(io.BytesIO(message.data.tobytes())).convert("RGB").save(out, "JPEG", quality=80)
                stamp = header(ns_of(message.header.stamp), "camera_front_optical")
                data = np.frombuffer(out.getvalue(), np.uint8)
                picture = T["sensor_msgs/msg/CompressedImage"](stamp, "jpeg", data)
                recorded.append(("/camera/front/image_raw/compressed", "sensor_msgs/msg/CompressedImage", time, picture))
            elif topic == "/camera/camera_info" and n % 5 == 0:
                message.header.frame_id = "camera_front_optical"
                recorded.append(("/camera/front/camera_info", kind, time, message))
            elif topic == "/lidar/points" and n % 10 == 0:
                step = message.point_step
                points = np.frombuffer(message.data.tobytes(), np.uint8).reshape(-1, step)[::100]
                message.data = np.ascontiguousarray(points).ravel()
                message.height, message.width, message.row_step = 1, len(points), len(message.data)
                message.header.frame_id = "lidar_top"
                recorded.append(("/lidar/points", kind, time, message))
            elif topic == "/imu/data" and n % 4 == 0:
                message.header.frame_id = "imu_link"
                recorded.append(("/imu/data", kind, time, message))
            elif topic == "/truth/odometry":
                pose = message.pose.pose
                q = [getattr(pose.orientation, k) for k in "xyzw"]
                place = np.array([getattr(pose.position, k) for k in "xyz"])
                poses.append((ns_of(message.header.stamp), Rotation.from_quat(q), place, message.twist.twist.linear.x))
    poses.sort(key=lambda pose: pose[0])
    at = np.array([pose[0] for pose in poses])
    places = np.array([pose[2] for pose in poses])
    for ns, rotation, place, _ in poses[::5]:
        moved = [transform(ns, "odom", "base_footprint", matrix(rotation, place))]
        recorded.append(("/tf", TF, ns, T[TF](moved)))
    fixes = np.arange(at[0], at[-1] + 1, 10**9)
    for i, ns in enumerate(fixes):
        east, north, up = (np.interp(ns, at, places[:, axis]) for axis in range(3))
        place = pymap3d.enu2geodetic(east, north, up, *ORIGIN)
        lost = i == 6
        status = T["sensor_msgs/msg/NavSatStatus"](-1 if lost else 0, 1)
        place = ORIGIN if lost else tuple(map(float, place))
        fix = T[FIX](header(int(ns), "gnss"), status, *place, np.zeros(9), 0)
        recorded.append(("/gnss/fix", FIX, int(ns), fix))
    frames = T[TF]([transform(start, *link) for link in static])
    recorded.append(("/tf_static", TF, start, frames))
    recorded.sort(key=lambda r: (r[2], r[0]))

    OUT.mkdir(exist_ok=True)
    write1(OUT / "drive.bag", recorded)
    write2(OUT / "drive_ros2", recorded)
    known = {
        "cam_from_vehicle": np.linalg.inv(vehicle_from_cam).tolist(),
        "cam_from_lidar": cam_from_lidar.tolist(),
        "vehicle_from_imu": vehicle_from_imu.tolist(),
        # The exact path, at its own times.
        "speeds": [[int(ns), speed] for ns, _, _, speed in poses],
        "images": counts["/camera/image_rect/compressed"] // 5 + 1,
    }
    (OUT / "drive.json").write_text(json.dumps(known, separators=(",", ":")) + "\n")
    for file in sorted(OUT.rglob("*")):
        if file.is_file():
            print(file.relative_to(OUT), file.stat().st_size, "bytes")


def write1(path, recorded):
    path.unlink(missing_ok=True)
    writer = Writer1(path)
    writer.set_compression(Writer1.CompressionFormat.BZ2)
    with writer:
        connections = {}
        for topic, kind, time, message in recorded:
            if topic not in connections:
                latching = 1 if topic == "/tf_static" else None
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS1, latching=latching)
            writer.write(connections[topic], time, ROS1.serialize_ros1(message, kind))


def as_ros2(value):
    """Without sequence numbers, CameraInfo's matrices in small letters."""
    if isinstance(value, list):
        return [as_ros2(v) for v in value]
    kind = getattr(type(value), "__msgtype__", None)
    if kind is None:
        return value
    make = ROS2.types[kind]
    names = [f for f in make.__dataclass_fields__ if not hasattr(make, f)]
    old = {f.lower(): f for f in value.__dataclass_fields__}
    return make(*(as_ros2(getattr(value, old[n])) for n in names))


def write2(path, recorded):
    shutil.rmtree(path, ignore_errors=True)
    with Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}
        images = 0
        for topic, kind, time, message in recorded:
            # The frames and the positions are what matters here; all images, and the scans, are in the other bag.
            images += kind.endswith("CompressedImage")
            if kind.endswith("PointCloud2") or (kind.endswith("CompressedImage") and images % 5 != 1):
                continue
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS2)
            writer.write(connections[topic], time, bytes(ROS2.serialize_cdr(as_ros2(message), kind)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
