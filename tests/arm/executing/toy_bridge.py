"""Stands in for LeRobot's process: an arm of two channels, with a fault of its own.

As the toy arm, it keeps where it stands in a folder, and its process's number for a motion.
"""

import json
import os
import sys
import time
from pathlib import Path

from tests.arm.executing.toy_arm import note_motion

settings = json.loads(sys.argv[2])["robot"]
kind, folder = settings.get("kind", "works"), Path(settings["folder"])
units = settings.get("columns", {"joint1.pos": "degrees", "gripper.pos": "range_0_100"})
sizes = [57.29577951308232 if unit == "degrees" else 1.0 for unit in units.values()]
pose = {name: 20.0 * (unit == "range_0_100") for name, unit in units.items()}
if (folder / "pose").exists():
    stands = map(float, (folder / "pose").read_text().split())
    pose = {name: s * size for name, s, size in zip(units, stands, sizes, strict=True)}


def say(content):
    print(json.dumps(content), flush=True)


if kind == "not there":
    say({"error": "Could not connect on port"})
    sys.exit()
if kind == "percent":
    units = dict.fromkeys(units, "range_m100_100")
if kind == "mute":
    units = {"joint1.pos": "degrees"}
say({"columns": list(pose), "units": units, "half_ranges": dict.fromkeys(pose, 90.0)})
moves = 0
for line in sys.stdin:
    request = json.loads(line)
    sent = request.get("goal", {})
    if sent and not moves:
        note_motion(folder)
    moves += bool(sent)
    middle = moves == 20
    if kind == "unplugged" and middle:
        say({"error": "There is no status packet!"})
        break
    if kind == "crashes" and middle:
        os._exit(3)
    if kind == "slow" and middle:
        time.sleep(0.3)
    if kind == "silent" and middle:
        time.sleep(60)
    if kind == "clips" and middle:
        first = next(iter(sent))
        sent = sent | {first: sent[first] / 2 - 1}
    if sent and not (kind == "blocked" and moves > 20):
        pose = dict(sent)
        place = " ".join(str(q / size) for q, size in zip(pose.values(), sizes, strict=True))
        (folder / "pose").write_text(place)
    if sent:
        with (folder / "log").open("a") as log:
            log.write(json.dumps(sent) + "\n")
        time.sleep(settings.get("seconds", 0.0) / 60)
    seen = dict(pose)
    if kind == "forgets" and moves >= 20:
        del seen["joint1.pos"]
    led = {"sent": dict.fromkeys(pose, 9.0)} if kind == "led" else {}
    say({"measured": seen} | ({"sent": sent} if sent else {}) | led)
