#!/usr/bin/env python3
"""Frames of random bytes and what cantools (MIT) decodes from them with vehicle.dbc.

Needs: pip install cantools==45.1.0
Run in this folder: python dbc.py > dbc.json
"""
import json
import math
import random

import cantools

db = cantools.database.load_file("vehicle.dbc", strict=True)
rng = random.Random(20)
frames = []
for message in db.messages:
    wanted, tries = 24, 0
    while wanted and tries < 5000:
        tries += 1
        data = bytearray(rng.randrange(256) for _ in range(message.length))
        if message.name == "NESTED" and tries % 2:
            data[0] = rng.choice([0x32, 0x72, 0x82, 0x92])  # pages that reach the innermost signal
        data = bytes(data)
        try:
            values = message.decode(data, decode_choices=False)
        except Exception:
            continue  # a page that the file does not list
        if any(isinstance(v, float) and not math.isfinite(v) for v in values.values()):
            continue
        frames.append({
            "message": message.name,
            "id": message.frame_id,
            "extended": message.is_extended_frame,
            "data": data.hex(),
            "all": [s.name for s in message.signals],
            "values": values,
        })
        wanted -= 1
print(json.dumps(frames, separators=(",", ":")).replace("},{\"message", "},\n{\"message"))
