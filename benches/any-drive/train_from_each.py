#!/usr/bin/env python3
"""One simulated drive in the forms that people have, each learned from by one command, and the scale that comes out.

    pip install numpy pillow piexif gpxpy rosbags pymap3d     (and ffmpeg on the path)
    benches/any-drive/train_from_each.py DEEPFUSION OUT [--steps 500] [--forms exact video_gpx ...]

Simulates a drive of 400 frames, writes the first 300 as `exact` (KITTI raw, as simulated), `video_gpx` (MP4 and a GPX track of one fix a second),
`video_obd` (MP4 and Torque's table, whole km/h twice a second), `bag` (ROS 1: /tf_static, CameraInfo, NavSatFix, an inertial unit),
`mcap` (the same for ROS 2) and `exif` (photographs with a focal length in EXIF, a table of speeds)
and `phone` (MP4 and Sensor Logger's folder).
Each is learned from with `deepfusion train --data FORM` in small steps that end in smaller ones (SETTINGS: with large ones to the end the scale is off by
several per cent from chance alone), and measured by the exact depth of the last 90 frames, farther along the street. `fast` is a control: the exact
log, but every speed a quarter too high; its scale has to be wrong by as much. A table on stdout; OUT/scales.json keeps what is done already.
"""

import argparse
import csv
import datetime
import json
import math
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

START = datetime.datetime(2026, 5, 1, 12, 0, 0, tzinfo=datetime.timezone.utc)
ORIGIN = (49.0, 8.4, 117.0)
SEED, FRAMES, LEARNED, GAP = 70_001, 400, 300, 10
SIZE = "320x96"
SETTINGS = ("learning_rate=0.0003", "learning_rate_schedule=cosine")
# Of a receiver that is in a good mood: metres, standard deviation of white noise and of its slow walk over a minute.
WHITE_M, WALK_M = 0.15, 1.0


class Drive:
    """A simulated drive in KITTI raw's layout."""

    def __init__(self, root):
        self.folder = next(root.rglob("oxts")).parent
        self.images = sorted((self.folder / "image_02" / "data").glob("*.png"))[:LEARNED]
        stamps = (self.folder / "image_02" / "timestamps.txt").read_text().split("\n")
        moments = [datetime.datetime.fromisoformat(line[:26]) for line in stamps if line]
        self.times = np.array([(m - moments[0]).total_seconds() for m in moments])[:LEARNED]
        oxts = [list(map(float, p.read_text().split())) for p in sorted((self.folder / "oxts" / "data").glob("*.txt"))]
        self.oxts = np.array(oxts)[:LEARNED]
        self.speed, self.gyro, self.accel = self.oxts[:, 8], self.oxts[:, 17:20], self.oxts[:, 11:14]
        # Where the camera was: x to the east, y to the north.
        poses = np.loadtxt(next(self.folder.rglob("poses.txt"))).reshape(-1, 3, 4)
        self.places = poses[:LEARNED, :, 3]
        for line in (self.folder.parent / "calib_cam_to_cam.txt").read_text().splitlines():
            if line.startswith("P_rect_02"):
                p = list(map(float, line.split()[1:]))
        self.k = (p[0], p[5], p[2], p[6])
        self.size = Image.open(self.images[0]).size

    def geodetic(self, at):
        import pymap3d

        return pymap3d.enu2geodetic(*(np.interp(at, self.times, self.places[:, axis]) for axis in range(3)), *ORIGIN)

    def intrinsics_txt(self):
        return " ".join(f"{v:.6f}" for v in self.k) + "\n"


def video(drive, out):
    """Frame times are the simulator's: ten a second."""
    rate = (len(drive.times) - 1) / (drive.times[-1] - drive.times[0])
    subprocess.run(
        ["ffmpeg", "-v", "error", "-y", "-framerate", f"{rate:.6f}", "-start_number", "0", "-i", str(drive.images[0].parent / "%010d.png"),
         "-frames:v", str(LEARNED), "-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p", "-metadata", f"creation_time={START.isoformat()}", str(out)],
        check=True,
    )  # fmt: skip


def video_exact(drive, out):
    video(drive, out / "drive.mp4")
    (out / "intrinsics.txt").write_text(drive.intrinsics_txt())
    rows = [f"{t:.4f},{speed:.4f}" for t, speed in zip(drive.times, drive.speed)]
    (out / "speed.csv").write_text("\n".join(["time_s,speed_mps", *rows]) + "\n")
    return "every frame's exact speed, images as compressed in the video"


def video_gpx(drive, out):
    import gpxpy.gpx

    video(drive, out / "drive.mp4")
    (out / "intrinsics.txt").write_text(drive.intrinsics_txt())
    rng = np.random.default_rng(1)
    at = np.arange(0.0, drive.times[-1] + 1e-6, 1.0)
    north, east, _ = drive.geodetic(at)
    walk = np.cumsum(rng.normal(size=(len(at), 2)), 0) * WALK_M / math.sqrt(60)
    moved = walk + rng.normal(size=(len(at), 2)) * WHITE_M
    north = north + moved[:, 1] / 111_200
    east = east + moved[:, 0] / (111_320 * np.cos(np.radians(ORIGIN[0])))
    segment = gpxpy.gpx.GPXTrackSegment()
    for t, lat, lon in zip(at, north, east):
        moment = START + datetime.timedelta(seconds=float(t))
        segment.points.append(gpxpy.gpx.GPXTrackPoint(round(float(lat), 7), round(float(lon), 7), elevation=117, time=moment))
    track = gpxpy.gpx.GPXTrack()
    track.segments.append(segment)
    whole = gpxpy.gpx.GPX()
    whole.tracks.append(track)
    (out / "drive.gpx").write_text(whole.to_xml())
    return "a fix a second, no speeds"


def video_obd(drive, out):
    video(drive, out / "drive.mp4")
    (out / "intrinsics.txt").write_text(drive.intrinsics_txt())
    (out / "dataset.toml").write_text('speed = "trackLog.csv"\n')
    with open(out / "trackLog.csv", "w") as file:
        file.write("GPS Time,Device Time, Longitude, Latitude,GPS Speed (Meters/second), Bearing,G(x),Speed (OBD)(km/h),Engine RPM(rpm)\n")
        for t in np.arange(0.0, drive.times[-1], 0.5):
            moment = START + datetime.timedelta(seconds=float(t))
            speed = 3.6 * np.interp(t, drive.times, drive.speed)
            gps = moment.strftime("%a %b %d %H:%M:%S GMT+00:00 %Y")
            device = moment.strftime("%d-%b-%Y %H:%M:%S.") + f"{moment.microsecond // 1000:03d}"
            file.write(f"{gps},{device},8.4,49.0,-,-,0.0,{round(speed)},1800\n")
    return "whole km/h, twice a second"


def phone(drive, out):
    """A phone that hangs askew: its gyroscope and gravity are turned by anything, its receiver says a speed a second."""
    video(drive, out / "drive.mp4")
    (out / "intrinsics.txt").write_text(drive.intrinsics_txt())
    (out / "dataset.toml").write_text('speed = "log"\n')
    (out / "log").mkdir()
    start = int(START.timestamp()) * 10**9
    rng = np.random.default_rng(2)
    up = np.array([0.2, 0.9, 0.3]) / np.linalg.norm([0.2, 0.9, 0.3])

    def table(name, head, rows):
        with open(out / "log" / name, "w") as file:
            file.write(f"time,seconds_elapsed,{head}\n")
            for t, values in rows:
                file.write(f"{start + round(t * 1e9)},{t:.3f}," + ",".join(f"{v:.7f}" for v in values) + "\n")

    def place(t):
        speed = np.interp(t, drive.times, drive.speed) + rng.normal() * 0.1
        latitude, longitude, _ = drive.geodetic(t)
        ahead = drive.geodetic(min(t + 0.2, drive.times[-1])), drive.geodetic(max(t - 0.2, 0.0))
        north, east = (float(a - b) for a, b in zip(ahead[0][:2], ahead[1][:2]))
        bearing = math.degrees(math.atan2(east * math.cos(math.radians(ORIGIN[0])), north)) % 360
        return 5.0, 0.3, 3.0, 4.0, speed, bearing, 110.0, float(longitude), float(latitude)

    seconds = np.arange(0.0, drive.times[-1] + 1e-6, 1.0)
    head = "bearingAccuracy,speedAccuracy,verticalAccuracy,horizontalAccuracy,speed,bearing,altitude,longitude,latitude"
    table("Location.csv", head, [(t, place(t)) for t in seconds])
    fast = np.arange(0.0, drive.times[-1], 0.02)
    turns = np.interp(fast, drive.times, drive.gyro[:, 2])
    noise = rng.normal(size=(len(fast), 3)) * 0.003
    table("Gyroscope.csv", "z,y,x", [(t, (w * up + e)[::-1]) for t, w, e in zip(fast, turns, noise)])
    table("Gravity.csv", "z,y,x", [(t, (-9.81 * up)[::-1]) for t in fast])
    return "a speed a second from its receiver, gyroscope at 50 Hz"


def exif(drive, out):
    import piexif

    (out / "images").mkdir()
    # Of the diagonal, as CIPA DC-008 has it.
    exact_mm = 43.2666 * drive.k[0] / math.hypot(*drive.size)
    focal35 = round(exact_mm)
    tags = piexif.dump({"Exif": {piexif.ExifIFD.FocalLengthIn35mmFilm: focal35}})
    with open(out / "frames.csv", "w", newline="") as frames, open(out / "speed.csv", "w", newline="") as speeds:
        frames, speeds = csv.writer(frames), csv.writer(speeds)
        frames.writerow(["time_s", "file"])
        speeds.writerow(["time_s", "speed_mps"])
        for t, speed, path in zip(drive.times, drive.speed, drive.images):
            Image.open(path).convert("RGB").save(out / "images" / f"{path.stem}.jpg", quality=92, exif=tags)
            frames.writerow([f"{t:.4f}", f"{path.stem}.jpg"])
            speeds.writerow([f"{t:.4f}", f"{speed:.4f}"])
    return f"focal length {focal35} mm in EXIF, {exact_mm:.2f} mm in truth"


def messages(drive, store):
    """Topic, type, time in ns, message: a vehicle's sensors on frames, without a file beside the bag."""
    import io

    from scipy.spatial.transform import Rotation

    types = store.types
    start = int(START.timestamp()) * 10**9
    ros1 = "seq" in types["std_msgs/msg/Header"].__dataclass_fields__

    def header(ns, frame):
        stamp = types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
        make = types["std_msgs/msg/Header"]
        return make(0, stamp, frame) if ros1 else make(stamp, frame)

    def frame(parent, child, rotation, place):
        moved = types["geometry_msgs/msg/Transform"](
            types["geometry_msgs/msg/Vector3"](*map(float, place)), types["geometry_msgs/msg/Quaternion"](*map(float, rotation.as_quat()))
        )
        return types["geometry_msgs/msg/TransformStamped"](header(start, parent), child, moved)

    # The positions are the camera's own: the receiver stands on it, and the vehicle's origin is below.
    optical = Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    still = Rotation.identity()
    frames = [
        frame("base_link", "mast", still, (0, 0, 1.0)),
        frame("mast", "camera", still, (0, 0, 0.65)),
        frame("camera", "camera_optical", optical, (0, 0, 0)),
        frame("base_link", "imu", still, (0, 0, 0.5)),
        frame("mast", "gnss", still, (0, 0, 0.65)),
    ]
    tf = "tf2_msgs/msg/TFMessage"
    yield "/tf_static", tf, start, types[tf](frames)
    width, height = drive.size
    fx, fy, cx, cy = drive.k
    matrix, projection = [fx, 0, cx, 0, fy, cy, 0, 0, 1], [fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0]
    roi = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    everything = []
    for n, (t, path) in enumerate(zip(drive.times, drive.images)):
        ns = start + round(t * 1e9)
        stamp = header(ns, "camera_optical")
        out = io.BytesIO()
        Image.open(path).convert("RGB").save(out, "JPEG", quality=92)
        picture = types["sensor_msgs/msg/CompressedImage"](stamp, "jpeg", np.frombuffer(out.getvalue(), np.uint8))
        everything.append(("/camera/image_rect/compressed", "sensor_msgs/msg/CompressedImage", ns, picture))
        numbers = [np.array(v, float) for v in ([0] * 5, matrix, np.eye(3).ravel(), projection)]
        info = types["sensor_msgs/msg/CameraInfo"](stamp, height, width, "plumb_bob", *numbers, 0, 0, roi)
        everything.append(("/camera/camera_info", "sensor_msgs/msg/CameraInfo", ns, info))
        if n % 2 == 0:
            place = (float(v) for v in drive.geodetic(t))
            status = types["sensor_msgs/msg/NavSatStatus"](0, 1)
            fix = types["sensor_msgs/msg/NavSatFix"](header(ns, "gnss"), status, *place, np.zeros(9), 0)
            everything.append(("/gnss/fix", "sensor_msgs/msg/NavSatFix", ns, fix))
        vector, unknown = types["geometry_msgs/msg/Vector3"], np.zeros(9)
        upright = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        imu = types["sensor_msgs/msg/Imu"](
            header(ns, "imu"), upright, np.full(9, -1.0), vector(*drive.gyro[n]), unknown, vector(*drive.accel[n]), unknown
        )
        everything.append(("/imu/data", "sensor_msgs/msg/Imu", ns, imu))
    yield from everything


def ros_store(which):
    from rosbags.typesys import get_types_from_msg, get_typestore

    store = get_typestore(which)
    types = get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", "tf2_msgs/msg/TFMessage")
    store.register({name: fields for name, fields in types.items() if name not in store.types})
    return store


def bag(drive, out):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores

    store = ros_store(Stores.ROS1_NOETIC)
    with Writer(out / "drive.bag") as writer:
        topics = {}
        for topic, kind, ns, message in messages(drive, store):
            if topic not in topics:
                latching = 1 if topic == "/tf_static" else None
                topics[topic] = writer.add_connection(topic, kind, typestore=store, latching=latching)
            writer.write(topics[topic], ns, store.serialize_ros1(message, kind))
    return "five fixes a second, an inertial unit"


def mcap(drive, out):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores

    store = ros_store(Stores.ROS2_HUMBLE)
    with Writer(out / "drive", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {}
        for topic, kind, ns, message in messages(drive, store):
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(topics[topic], ns, bytes(store.serialize_cdr(message, kind)))
    return "the same"


def part(drive, out, frames):
    """Some frames of the drive as it was simulated."""
    shutil.copytree(drive.folder.parent, out / drive.folder.parent.name)
    for image in (out / drive.folder.parent.name / drive.folder.name / "image_02" / "data").glob("*.png"):
        if int(image.stem) not in frames:
            image.unlink()


def exact(drive, out):
    part(drive, out, range(LEARNED))
    return "every frame's exact speed"


def fast(drive, out):
    exact(drive, out)
    for path in (out / drive.folder.parent.name / drive.folder.name / "oxts" / "data").glob("*.txt"):
        values = path.read_text().split()
        for place in range(6, 11):
            values[place] = repr(1.25 * float(values[place]))
        path.write_text(" ".join(values) + "\n")
    return "every speed a quarter too high"


# What writes each form, and what of it is given to the program.
FORMS = {
    "exact": (exact, ""), "video_exact": (video_exact, ""), "video_gpx": (video_gpx, ""), "video_obd": (video_obd, ""), "bag": (bag, "drive.bag"),
    "mcap": (mcap, "drive"), "exif": (exif, ""), "phone": (phone, ""),
    "fast": (fast, ""),
}  # fmt: skip


def run(*words):
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))}\n{done.stderr}")
    return done


def main():
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("program")
    words.add_argument("out", type=Path)
    words.add_argument("--steps", type=int, default=500)
    words.add_argument("--forms", nargs="+", default=list(FORMS), choices=FORMS)
    words.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", help="further settings of the training, such as precision=bf16")
    words.add_argument("--init", help="the network to begin from, instead of the program's own choice")
    asked = words.parse_args()
    out = asked.out
    out.mkdir(parents=True, exist_ok=True)
    simulated, test = out / "simulated", out / "test"
    if not test.exists():
        for old in (simulated, test):
            shutil.rmtree(old, ignore_errors=True)
        run(asked.program, "simulate", "--out", simulated, "--frames", FRAMES, "--seed", SEED, "--size", SIZE, "--scan-every", 4)
        part(Drive(simulated), test, range(LEARNED + GAP, FRAMES))
    drive = Drive(simulated)
    kept = out / "scales.json"
    scales = json.loads(kept.read_text()) if kept.exists() else {}
    for form in asked.forms:
        if form in scales:
            continue
        folder, model = out / form, out / f"run_{form}"
        for old in (folder, model):
            shutil.rmtree(old, ignore_errors=True)
        folder.mkdir()
        write, given = FORMS[form]
        what = write(drive, folder)
        init = ("--init", asked.init) if asked.init else ()
        init += tuple(word for setting in (*SETTINGS, *asked.set) for word in ("--set", setting))
        run(asked.program, "train", "--data", folder / given, *init, "--steps", asked.steps, "--out", model)
        found = json.loads(run(asked.program, "eval", "--model", model, "--data", test, "--no-verdict", "--crop", "none", "--json").stdout)
        scales[form] = {"what": what, "scale": found["scale"]["median"], "abs_rel": found["unscaled"]["abs_rel"]}
        kept.write_text(json.dumps(scales, indent=1))
        print(form, scales[form], file=sys.stderr, flush=True)
    print("| form | its speeds | `scale.median` | over that of the exact log | abs_rel |")
    print("|---|---|---|---|---|")
    for form, row in scales.items():
        ratio = row["scale"] / scales["exact"]["scale"] if "exact" in scales else math.nan
        print(f"| {form} | {row['what']} | {row['scale']:.3f} | {ratio:.3f} | {row['abs_rel']:.3f} |")


if __name__ == "__main__":
    main()
