"""Writes the frames of candump.log as Vector's BLF, for tests/blf.rs.

    pip install python-can==4.6.1 && python make_blf.py

The frames come from python-can's reader of candump.log and are written by python-can's BLFWriter, with zlib and without. What that
writer does not write (CAN_MESSAGE2, CAN_FD_MESSAGE_64, times in steps of 10 µs, header version 2) is packed with its own structures.
Every file is read back with python-can's BLFReader, and must hold the same frames.
"""

import struct
from pathlib import Path

import can
from can.io import blf

HERE = Path(__file__).parent
FRAMES = list(can.CanutilsLogReader(HERE / "candump.log"))


class TenMicroseconds(can.BLFWriter):
    """CAN_MESSAGE2 and CAN_FD_MESSAGE_64 alternately, after a header of version 2, with times of 10 µs."""

    def on_message_received(self, msg):
        identifier = msg.arbitration_id | (blf.CAN_MSG_EXT if msg.is_extended_id else 0)
        data = bytes(msg.data)
        if self.object_count % 2 == 0 or msg.is_extended_id:
            body = blf.CAN_FD_MSG_64_STRUCT.pack(1, can.util.len2dlc(msg.dlc), len(data), 0, identifier, 0, 0x1000, 0, 0, 0, 0, 0, 0, 0, 0) + data
            kind = blf.CAN_FD_MESSAGE_64
        else:
            body = blf.CAN_MSG_STRUCT.pack(1, 0, msg.dlc, identifier, data) + struct.pack("<LBBH", 0, 0, 0, 0)
            kind = blf.CAN_MESSAGE2
        self._add_object(kind, body, msg.timestamp)

    def _add_object(self, kind, data, timestamp=None):
        if self.start_timestamp is None:
            self.start_timestamp = int(timestamp * 1000) / 1000
        self.stop_timestamp = timestamp
        ticks = round((timestamp - self.start_timestamp) * 1e5)
        size = blf.OBJ_HEADER_BASE_STRUCT.size + blf.OBJ_HEADER_V2_STRUCT.size
        head = blf.OBJ_HEADER_BASE_STRUCT.pack(b"LOBJ", size, 2, size + len(data), kind)
        head += blf.OBJ_HEADER_V2_STRUCT.pack(blf.TIME_TEN_MICS, 0, 0, ticks)
        # Vector's own padding.
        whole = head + data + b"\0" * ((size + len(data)) % 4)
        self._buffer.append(whole)
        self._buffer_size += len(whole)
        self.object_count += 1
        if self._buffer_size >= self.max_container_size:
            self._flush()


def write(name, writer, frames, tolerance_s, **options):
    with writer(HERE / name, **options) as log:
        for frame in frames:
            log.on_message_received(frame)
    back = list(can.BLFReader(HERE / name))
    assert len(back) == len(FRAMES), (name, len(back))
    for ours, theirs in zip(FRAMES, back):
        assert ours.arbitration_id == theirs.arbitration_id and ours.is_extended_id == theirs.is_extended_id
        assert bytes(ours.data) == bytes(theirs.data) and abs(ours.timestamp - theirs.timestamp) < tolerance_s, (name, ours, theirs)


def as_fd(frame):
    return can.Message(timestamp=frame.timestamp, arbitration_id=frame.arbitration_id, is_extended_id=frame.is_extended_id, is_fd=True, data=frame.data, channel=0)


# Containers so small that objects begin in one and end in the next.
write("vector.blf", can.BLFWriter, FRAMES, 1e-6, max_container_size=1000)
write("plain.blf", can.BLFWriter, FRAMES, 1e-6, compression_level=0, max_container_size=3000)
write("fd.blf", can.BLFWriter, [as_fd(f) for f in FRAMES], 1e-6)
write("ten_microseconds.blf", TenMicroseconds, FRAMES, 1e-5)
