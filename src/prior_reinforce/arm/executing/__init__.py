"""Ways of executing a plan on an arm: any command, or an executor by name."""

from prior_reinforce.arm.executing.base import Executor
from prior_reinforce.registry import Member, Registry

_HERE = "prior_reinforce.arm.executing"

EXECUTORS: Registry[Executor] = Registry(
    "executor",
    f"{_HERE}.base:Executor",
    {
        "fr3": Member(f"{_HERE}.fr3:FR3", "Franka Research 3"),
        "lerobot": Member(f"{_HERE}.lerobot:LeRobotArm", "any arm that LeRobot drives"),
        "ur": Member(f"{_HERE}.ur:UR", "Universal Robots' UR5e and UR10e"),
    },
)
