"""Writes one log of each kind of the same drive, for tests/formats.rs.

    pip install gpxpy==1.6.2 python-can cantools && python make_logs.py

The drive: v(t) = 8 + 3 sin(0.4 t) m/s for 12 s from 2026-05-01 12:00:00 UTC, turning at 0.3 sin(0.5 t) rad/s. GPX is written by gpxpy,
candump and ASC by python-can with frames that cantools packs; the others follow the published definitions of their formats:
GPMF as in github.com/gopro/gpmf-parser's README (settings and lens as its users print them), MP4 as in ISO/IEC 14496-12, GnssLogger, Sensor Logger, Torque and Car Scanner as
their files' own headers say.
"""

import datetime as dt
import math
import struct
from pathlib import Path

import can
import cantools
import gpxpy.gpx
import numpy as np

HERE = Path(__file__).parent
START = dt.datetime(2026, 5, 1, 12, 0, 0, tzinfo=dt.timezone.utc)
SECONDS = 12.0
RADIUS = 6_378_137.0


def speed(t):
    return 8 + 3 * math.sin(0.4 * t)


def yaw_rate(t):
    return 0.3 * math.sin(0.5 * t)


def path():
    """Positions east and north and the heading (from east, to the left), every millisecond."""
    t = np.arange(0, SECONDS + 1e-9, 1e-3)
    heading = np.concatenate([[0.0], np.cumsum([yaw_rate(x + 5e-4) for x in t[:-1]]) * 1e-3])
    v = np.array([speed(x) for x in t])
    east = np.concatenate([[0.0], np.cumsum(v[:-1] * np.cos(heading[:-1])) * 1e-3])
    north = np.concatenate([[0.0], np.cumsum(v[:-1] * np.sin(heading[:-1])) * 1e-3])
    return east, north, heading


EAST, NORTH, HEADING = path()


def place(t):
    """Latitude, longitude, bearing (clockwise from north), degrees."""
    i = min(round(t * 1000), len(EAST) - 1)
    latitude = 49.0 + math.degrees(NORTH[i] / RADIUS)
    longitude = 8.4 + math.degrees(EAST[i] / (RADIUS * math.cos(math.radians(49.0))))
    return latitude, longitude, (90 - math.degrees(HEADING[i])) % 360


def times(hz):
    return [i / hz for i in range(int(SECONDS * hz) + 1)]


def when(t):
    return START + dt.timedelta(seconds=t)


def write(name, lines, newline="\n"):
    target = HERE / name
    target.parent.mkdir(exist_ok=True)
    target.write_bytes((newline.join(lines) + newline).encode())


def gpx():
    track = gpxpy.gpx.GPX()
    segment = gpxpy.gpx.GPXTrackSegment()
    track.tracks.append(gpxpy.gpx.GPXTrack())
    track.tracks[0].segments.append(segment)
    for t in times(1):
        latitude, longitude, _ = place(t)
        segment.points.append(gpxpy.gpx.GPXTrackPoint(latitude, longitude, elevation=110.0, time=when(t)))
    (HERE / "phone.gpx").write_text(track.to_xml())


def torque():
    head = "GPS Time,Device Time, Longitude, Latitude,GPS Speed (Meters/second), Bearing,G(x),Speed (OBD)(km/h),Engine RPM(rpm)"
    lines = [head]
    for i, t in enumerate(times(2)):
        latitude, longitude, bearing = place(t)
        gps = when(math.floor(t)).strftime("%a %b %d %H:%M:%S GMT+00:00 %Y")
        device = when(t).strftime("%d-%b-%Y %H:%M:%S.") + f"{int(when(t).microsecond / 1000):03d}"
        obd = "-" if i % 5 == 4 else f"{speed(t) * 3.6:.3f}"
        lines.append(f"{gps},{device},{longitude:.7f},{latitude:.7f},{speed(t) + 1:.3f},{bearing:.1f},0.01,{obd},1800")
        if i == 10:
            lines.append(head)
    write("torque.csv", lines)


def car_scanner():
    lines = ['"SECONDS";"PID";"VALUE";"UNITS";"LATITUDE";"LONGTITUDE";']
    for t in times(4):
        latitude, longitude, _ = place(t)
        at, where = f"{43200.25 + t:.6f}".replace(".", ","), f'"{latitude:.7f}";"{longitude:.7f}";'
        lines.append(f'"{at}";"Average speed";"20";"km/h";{where}')
        lines.append(f'"{at}";"Engine RPM";"1800";"rpm";{where}')
        value = f"{speed(t) / 0.44704:.4f}".replace(".", ",")
        lines.append(f'"{at}";"Vehicle speed";"{value}";"mph";{where}')
    write("car_scanner.csv", lines, "\r\n")


def sensor_logger():
    """The phone is mounted askew, and its platform's gravity points down: the sign of a turn has to be found."""
    up = np.array([0.2, 0.9, 0.3])
    up /= np.linalg.norm(up)
    ns = lambda t: int(START.timestamp()) * 10**9 + round(t * 1e9)
    lines = ["time,seconds_elapsed,bearingAccuracy,speedAccuracy,verticalAccuracy,horizontalAccuracy,speed,bearing,altitude,longitude,latitude"]
    lines.append(f"{ns(-1)},-1.0,-1,-1,-1,50,-1,-1,110,8.4,49.0")
    for t in times(1):
        latitude, longitude, bearing = place(t)
        lines.append(f"{ns(t)},{t},5.0,0.3,3.0,4.0,{speed(t):.4f},{bearing:.3f},110,{longitude:.7f},{latitude:.7f}")
    write("sensor_logger/Location.csv", lines)
    for name, of in [("Gyroscope", lambda t: yaw_rate(t) * up), ("Gravity", lambda t: -9.81 * up)]:
        rows = [(t, *of(t)) for t in times(25)]
        write(f"sensor_logger/{name}.csv", ["time,seconds_elapsed,z,y,x"] + [f"{ns(t)},{t},{z:.6f},{y:.6f},{x:.6f}" for t, x, y, z in rows])


def phyphox():
    lines = ['"Time (s)","Latitude (°)","Longitude (°)","Height (m)","Velocity (m/s)","Direction (°)","Horizontal Accuracy (m)"']
    for t in times(1):
        latitude, longitude, bearing = place(t)
        lines.append(f"{t:.9E},{latitude:.9E},{longitude:.9E},1.1E2,{speed(t):.9E},{bearing:.9E},4.0E0")
    write("phyphox.csv", lines)


def gnss_logger():
    lines = [
        "# ",
        "# Version: v3.0.6.4 Platform: 14",
        "# Raw,utcTimeMillis,TimeNanos,LeapSecond",
        "# Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,BearingDegrees,UnixTimeMillis,SpeedAccuracyMps",
    ]
    for t in times(1):
        latitude, longitude, bearing = place(t)
        ms = round(when(t).timestamp() * 1000)
        lines.append(f"Raw,{ms},123456789,18")
        lines.append(f"Fix,GPS,{latitude:.7f},{longitude:.7f},110.0,{speed(t):.5f},4.0,{bearing:.2f},{ms},0.2")
        lines.append(f"Fix,NLP,{latitude:.3f},{longitude:.3f},,0.0,400.0,,{ms + 300},")
    write("gnss_log.txt", lines)


def table():
    """A table of an unknown program: German numbers, a local date, knots in a column of its own name."""
    lines = ["Zeitpunkt;Fahrt;Bemerkung"]
    for t in times(5):
        stamp = when(t).strftime("%d.%m.%Y %H:%M:%S.") + f"{int(when(t).microsecond / 1000):03d}"
        lines.append(f"{stamp};" + f"{speed(t) * 3600 / 1852:.4f}".replace(".", ",") + ";ok")
    write("german.csv", lines)


DBC = """VERSION ""

NS_ :

BS_:

BU_: ECU

BO_ 291 WheelSpeeds: 8 ECU
 SG_ VehicleSpeed : 7|16@0+ (0.01,0) [0|655.35] "km/h" ECU
 SG_ Counter : 56|8@1+ (1,0) [0|255] "" ECU
"""


def can_traces():
    (HERE / "vehicle.dbc").write_text(DBC)
    database = cantools.database.load_string(DBC, "dbc")
    frames = []
    for i, t in enumerate(times(10)):
        data = database.encode_message("WheelSpeeds", {"VehicleSpeed": speed(t) * 3.6, "Counter": i % 256})
        stamp = START.timestamp() + t
        frames.append(can.Message(timestamp=stamp, arbitration_id=291, is_extended_id=False, data=data, channel=0))
        frames.append(can.Message(timestamp=stamp + 0.001, arbitration_id=0x18FEF100, is_extended_id=True, data=b"\x01\x02", channel=0))
    with can.CanutilsLogWriter(HERE / "candump.log") as log:
        for frame in frames:
            log.on_message_received(frame)
    with can.ASCWriter(HERE / "vector.asc") as log:
        for frame in frames:
            log.on_message_received(frame)


def gpmf():
    def klv(key, kind, size, count, value):
        return key.encode() + kind.encode() + struct.pack(">BH", size, count) + value + b"\0" * (-len(value) % 4)

    def nest(key, value):
        return klv(key, "\0", 1, len(value), value)

    up = np.array([0.1, -0.3, 0.95])
    up /= np.linalg.norm(up)

    def payload(second):
        at = [second + i / 10 for i in range(10)]
        rows = [(*place(t)[:2], 110.0, speed(t), speed(t)) for t in at]
        scale = [10_000_000, 10_000_000, 1000, 1000, 100]
        gps = b"".join(struct.pack(">5l", *(round(v * s) for v, s in zip(row, scale))) for row in rows)
        fix = 0 if second == 0 else 3
        gps_stream = nest("STRM", klv("GPSF", "L", 4, 1, struct.pack(">L", fix)) + klv("SCAL", "l", 4, 5, struct.pack(">5l", *scale)) + klv("GPS5", "l", 20, 10, gps))
        fine = [second + i / 50 for i in range(50)]
        gyro = b"".join(struct.pack(">3h", *np.round(yaw_rate(t) * up * 3755).astype(int)) for t in fine)
        accl = b"".join(struct.pack(">3h", *np.round(9.81 * up * 417).astype(int)) for t in fine)
        gyro_stream = nest("STRM", klv("SCAL", "s", 2, 1, struct.pack(">h", 3755)) + klv("GYRO", "s", 6, 50, gyro))
        accl_stream = nest("STRM", klv("SCAL", "s", 2, 1, struct.pack(">h", 417)) + klv("ACCL", "s", 6, 50, accl))
        return nest("DEVC", klv("DVNM", "c", 1, 5, b"Hero8") + gps_stream + gyro_stream + accl_stream)

    def box(kind, *parts):
        value = b"".join(parts)
        return struct.pack(">L", 8 + len(value)) + kind.encode() + value

    payloads = [payload(s) for s in range(int(SECONDS))]
    n = len(payloads)
    head = box("ftyp", b"mp41", bytes(4), b"mp41")
    data = box("mdat", *payloads)
    offsets, at = [], len(head) + 8
    for p in payloads:
        offsets.append(at)
        at += len(p)
    full = bytes(4)
    u32 = lambda *v: struct.pack(f">{len(v)}L", *v)
    table = box(
        "stbl",
        box("stsd", full, u32(1), box("gpmd", bytes(6), struct.pack(">H", 1), bytes(4))),
        box("stts", full, u32(1, n, 1001)),
        box("stsc", full, u32(1, 1, 1, 1)),
        box("stsz", full, u32(0, n, *map(len, payloads))),
        box("stco", full, u32(n, *offsets)),
    )
    media = box("mdia", box("mdhd", full, u32(0, 0, 1001, n * 1001), bytes(4)), box("hdlr", full, bytes(4), b"meta", bytes(13)), box("minf", table))
    # Settings of the whole video, and of its lens.
    text = lambda key, value: klv(key, "c", 1, len(value), value.encode())
    settings = nest("DEVC", text("DVNM", "Global Settings") + text("MINF", "HERO11 Black") + text("DZOM", "Y") + klv("DZST", "L", 4, 1, u32(0)) + klv("VRES", "L", 4, 2, u32(1920, 1080)))
    lens = nest("DEVC", text("DVNM", "Large FOV") + klv("ZFOV", "f", 4, 1, struct.pack(">f", 94.0)) + text("VFOV", "L"))
    movie = box("moov", box("trak", media), box("udta", box("FIRM", b"H22.01"), box("GPMF", settings, lens)))
    (HERE / "gopro.mp4").write_bytes(head + data + movie)


for make in (gpx, torque, car_scanner, sensor_logger, phyphox, gnss_logger, table, can_traces, gpmf):
    make()
