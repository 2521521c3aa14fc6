"""The command line, one command a class: a frozen dataclass of its flags, and `run`."""

from __future__ import annotations

import sys

from prior_reinforce.terminal import RED, YELLOW, coloured, plain

_HERE = "prior_reinforce.commands"
GROUPS: dict[str, dict[str, tuple[str, str]]] = {
    "your arm": {
        "new": ("workspace:New", "make a workspace: a folder for one task of one arm"),
        "import": ("importing:Import", "bring recorded demonstrations into it"),
        "record": ("record:Record", "record demonstrations at the arm, and import them"),
        "learn": ("learning:Learn", "learn the motion from them"),
        "goal": ("workspace:Goal", "set the goal of the next trials"),
        "ask": ("trials:Ask", "get the plan of the next trial, and execute it"),
        "tell": ("telling:Tell", "say where the object went"),
        "amend": ("telling:Amend", "correct what was told"),
        "void": ("telling:Void", "discard a trial; nothing is learned from it"),
        "status": ("workspace:Status", "where you are, and what comes next"),
        "advise": ("advice:Advise", "where throws would hit, and what would teach most"),
        "trials": ("workspace:Trials", "all trials as a table, CSV or JSON"),
        "log": ("workspace:Log", "all events, one JSON object a line"),
        "report": ("workspace:Report", "write a page with every goal, trial and plan"),
        "export": ("trials:Export", "write a trial's plan as NPZ, CSV or JSON"),
        "console": ("console:Console", "open a page to work on beside the arm"),
        "calibrate": ("photographs:Calibrate", "fit the camera above the table"),
        "look": ("photographs:Look", "see a trial's error in a photograph"),
    },
    "simulated tasks": {
        "demo": ("simulated:Demo", "one demonstration, five new goals, a report"),
        "adapt": ("simulated:Adapt", "reach new goals, trial by trial"),
    },
}
"""Where each command's class is, and what it is for: only the one that is called is imported."""
COMMANDS = {
    name: f"{_HERE}.{target}" for group in GROUPS.values() for name, (target, _) in group.items()
}
_LONGEST = 1000
"""Characters of a message; ours: twelve lines of a terminal."""


def complain(message: str, colour: str = RED) -> None:
    """One line on standard error that can be read, whatever names and reasons hold."""
    line = plain(message)
    if len(line) > _LONGEST:  # what is wrong stands at the beginning, the remedy at the end
        line = f"{line[: _LONGEST // 2]} ... {line[-_LONGEST // 3 :]}"
    print(f"{coloured('prior-reinforce:', colour, sys.stderr)} {line}", file=sys.stderr)


def warn(message: Warning | str, *_: object, **__: object) -> None:
    """A warning in such a line; arguments as `warnings.showwarning` is given them."""
    complain(f"warning: {message}", YELLOW)
