"""Plans on disk, immutable and hashed, and their hand-over to whatever drives the arm."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from prior_reinforce.motions import Plan

PlanFileFormat = Literal["npz", "csv", "json"]


@dataclass(frozen=True)
class PlanFile:
    """A plan that was written once and will never change."""

    path: Path
    sha256: str


@dataclass(frozen=True)
class HandOver:
    """What became of a command that was given a plan."""

    command: tuple[str, ...]
    exit_status: int | None
    """None if the command was stopped at its time limit."""
    timed_out: bool
    seconds: float
    output_tail: str

    @property
    def succeeded(self) -> bool:
        """Whether the command ended by itself with status 0."""
        return self.exit_status == 0

    def as_json(self) -> dict[str, Any]:
        """The same as plain data for the journal."""
        raise NotImplementedError


def write_plan(
    plan: Plan,
    path: str | os.PathLike[str],
    *,
    format: PlanFileFormat | None = None,
    rate: float | None = None,
) -> PlanFile:
    """Write a plan, durable and read-only; the suffix gives the format unless `format` does.

    Args:
        plan: The plan.
        path: Where to; an existing file with the same content is kept, another one is an error.
        format: `npz` (t, q, dq, ddq), `csv`, or `json` in ROS 2 JointTrajectory's field order.
        rate: Samples a second; None writes the plan's own frames.

    Raises:
        FileFormatError: Unknown suffix, or another file is there already.
        WorkspaceError: The disk is full or the folder read-only; nothing is left behind.
    """
    raise NotImplementedError


def read_plan(path: str | os.PathLike[str], *, sha256: str | None = None) -> Plan:
    """Read an NPZ plan, and check its hash where one is given.

    Raises:
        FileFormatError: Missing, damaged, or not what the hash says.
    """
    raise NotImplementedError


def run_with_plan(command: str, plan_file: PlanFile, *, time_limit: float) -> HandOver:
    """Run `mycontroller {plan}` in a process of its own and wait for it.

    Raises:
        ConfigurationError: No `{plan}` in the command, or its program cannot be started.
        FileFormatError: The plan is no longer what its hash says.
    """
    raise NotImplementedError
