"""Stands in for LeRobot's process: an arm of one joint and a gripper, with a fault of its own."""

import json
import os
import sys
import time

settings = json.loads(sys.argv[2])["robot"]
kind = settings.get("kind", "works")
pose = {"joint1.pos": 0.0, "gripper.pos": 20.0}


def say(content):
    print(json.dumps(content), flush=True)


if kind == "not there":
    say({"error": "Could not connect on port"})
    sys.exit()
say(
    {
        "columns": list(pose),
        "units": {"joint1.pos": "range_m100_100" if kind == "percent" else "degrees"}
        | ({} if kind == "mute" else {"gripper.pos": "range_0_100"}),
        "half_ranges": {"joint1.pos": 90.0, "gripper.pos": 100.0},
    }
)
for cycle, line in enumerate(sys.stdin):
    request = json.loads(line)
    sent = request.get("goal", {})
    middle = cycle == 20
    if kind == "unplugged" and middle:
        say({"error": "There is no status packet!"})
        break
    if kind == "crashes" and middle:
        os._exit(3)
    if kind == "slow" and middle:
        time.sleep(0.3)
    if kind == "clips" and middle:
        sent = sent | {"joint1.pos": sent["joint1.pos"] / 2}
    if sent and not (kind == "jams" and cycle > 20):
        pose = dict(sent)
    if settings.get("log") and sent:
        with open(settings["log"], "a") as log:
            log.write(json.dumps(sent) + "\n")
    led = {"sent": {"joint1.pos": 9.0, "gripper.pos": 0.0}} if kind == "led" else {}
    say({"measured": pose} | ({"sent": sent} if sent else {}) | led)
