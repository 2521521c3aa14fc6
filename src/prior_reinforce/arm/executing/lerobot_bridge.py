"""LeRobot's side of the executor `lerobot`: a program that any Python with LeRobot can run.

    python lerobot_bridge.py SETTINGS

It imports nothing of this package, since LeRobot may be installed in a Python of its own. Requests
and answers are lines of JSON on its standard input and output. When the input ends, by a kill too,
it lets go of the robot, whose torque stays as LeRobot's settings say.
"""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import signal
import sys
from contextlib import suppress
from typing import Any

_TRIES = 3
"""How often positions are read before they count as lost. Ours: a packet is lost now and then, and
LeRobot waits 50 ms for each, after which the executor says that it was late."""

_JUMP = 20.0
"""How far an arm may stand from its leader when it begins to follow, in LeRobot's units (degrees,
per cent). Ours: it goes there as fast as it can."""


def make_device(family: str, settings: dict[str, Any]) -> Any:
    """Make a `robot` or a `teleoperator` of LeRobot from its `type` and other settings."""
    import draccus

    package = importlib.import_module(f"lerobot.{family}s")
    registry = getattr(package, f"{family.capitalize()}Config")
    name = settings["type"]
    for module in pkgutil.iter_modules(package.__path__):
        if name in registry.get_known_choices():
            break
        with suppress(ImportError):  # what another robot needs is not installed
            importlib.import_module(f"lerobot.{family}s.{module.name}")
    if name not in registry.get_known_choices():
        plugins = importlib.import_module("lerobot.utils.import_utils")
        plugins.register_third_party_plugins()
    kind = registry.get_choice_class(name)
    given = {key: value for key, value in settings.items() if key != "type"}
    if "disable_torque_on_disconnect" in kind.__dataclass_fields__:
        # An arm that was brought to a plan's first frame must not fall before the plan begins.
        given.setdefault("disable_torque_on_disconnect", False)
    return getattr(package, f"make_{family}_from_config")(draccus.decode(kind, given))


def _check_calibrated(device: Any) -> None:
    if not device.is_calibrated:
        raise ValueError(
            f"{device} is not calibrated, or not as its file says; run lerobot-calibrate"
        )


class Bridge:
    """A robot, and the teleoperator that leads it, if there is one."""

    def __init__(self, settings: dict[str, Any]) -> None:
        """Connect; nothing moves."""
        self.robot, leader = make_device("robot", settings["robot"]), settings["leader"]
        self.leader = make_device("teleoperator", leader) if leader else None
        self.bus: Any = getattr(self.robot, "bus", None)
        self._configure, self.robot.configure = self.robot.configure, self._configure_once
        self.robot.connect(calibrate=False)
        _check_calibrated(self.robot)

    def _configure_once(self) -> None:
        """LeRobot lets go of an arm to configure it; one that holds its pose is configured.

        It gives the servos torque again, which then go to the goal that they were given last: they
        are told to stay before.
        """
        if self.bus is None:
            self._configure()
        elif not all(self.bus.sync_read("Torque_Enable").values()):
            here = self.bus.sync_read("Present_Position", normalize=False)
            self.bus.sync_write("Goal_Position", here, normalize=False)
            self._configure()

    def describe(self) -> dict[str, Any]:
        """Columns, and of those that are known the unit and the ends of the calibrated range."""
        columns = [n for n, kind in self.robot.action_features.items() if kind is float]
        units, ranges = {}, {}
        for name in columns if self.bus is not None else ():
            motor = name.removesuffix(".pos")
            units[name] = self.bus.motors[motor].norm_mode.value
            calibration = self.bus.calibration[motor]
            half = (calibration.range_max - calibration.range_min) / 2
            turn = self.bus.model_resolution_table[self.bus.motors[motor].model] - 1
            ranges[name] = half * 360 / turn
        return {"columns": columns, "units": units, "half_ranges": ranges}

    def observe(self) -> dict[str, Any]:
        """Where every column stands."""
        columns = self.robot.action_features
        for left in reversed(range(_TRIES)):
            try:
                seen = self.robot.get_observation()
                break
            except ConnectionError:
                if not left:
                    raise
                self._forget_late_answers()
        return {"measured": {name: float(seen[name]) for name in columns if name in seen}}

    def _forget_late_answers(self) -> None:
        """LeRobot takes whatever comes next for the answer to what it asks next."""
        port = getattr(getattr(self.bus, "port_handler", None), "ser", None)
        if port is not None:
            port.reset_input_buffer()

    def move(self, goal: dict[str, float]) -> dict[str, Any]:
        """Send a goal, and observe."""
        sent = self.robot.send_action(goal)
        return {"sent": {name: float(sent[name]) for name in goal}, **self.observe()}

    def guide(self) -> dict[str, Any]:
        """One cycle of being guided: the robot goes where its leader is, if it has one."""
        if self.leader is None:
            return self.observe()
        if not self.leader.is_connected:
            self.leader.connect(calibrate=False)
            _check_calibrated(self.leader)
            here, there = self.observe()["measured"], self.leader.get_action()
            name = max(there, key=lambda n: abs(there[n] - here[n]))
            if abs(there[name] - here[name]) > _JUMP:
                raise ValueError(
                    f"{name} of the leader is {abs(there[name] - here[name]):.0f} from the arm's, "
                    "which would jump there; bring the leader to where the arm is"
                )
        return self.move(self.leader.get_action())

    def release(self) -> dict[str, Any]:
        """Switch the torque off, for a person to guide the arm by hand; a leader needs it on."""
        if self.leader is None and self.bus is not None:
            self.bus.disable_torque()
        return {}

    def close(self) -> None:
        """Let go of both ends; what is unplugged is gone already."""
        for device in (self.leader, self.robot):
            with suppress(Exception):
                if device is not None and device.is_connected:
                    device.disconnect()


def main() -> None:
    """Answer requests until the input ends."""
    del sys.path[0]  # this folder, whose lerobot.py is not LeRobot
    # The program that asks decides when the arm stops; the end of the input ends this one.
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what LeRobot prints is no answer

    def answer(content: dict[str, Any]) -> None:
        with suppress(OSError):  # nobody listens any more, so the input has ended too
            print(json.dumps(content), file=answers, flush=True)

    bridge = None
    try:
        bridge = Bridge(json.loads(sys.argv[1]))
        answer(bridge.describe())
        for line in sys.stdin:
            request = json.loads(line)
            answer(getattr(bridge, request.pop("do"))(**request))
    except Exception as error:  # LeRobot's drivers raise what they like
        answer({"error": " ".join(str(error).split()) or repr(error)})
    finally:
        if bridge is not None:
            bridge.close()


if __name__ == "__main__":
    main()
