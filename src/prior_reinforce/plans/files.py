"""Plans on disk: written once, read-only, known by their SHA-256 hash."""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import cast, get_args

import numpy as np

from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidPlanError,
    PriorReinforceError,
    WorkspaceError,
)
from prior_reinforce.files import write_once
from prior_reinforce.plans.encoding import (
    FILE_FORMAT,
    FILE_VERSION,
    PlanFileFormat,
    encode_plan,
)
from prior_reinforce.plans.motions import Plan, PlanFormat
from prior_reinforce.robots.executors.command import HandOver, run_command

_HIGHEST_RATE = 1e5
"""Samples a second; ours: a hundred times what the fastest arms are sent, in a file still small."""


@dataclass(frozen=True)
class PlanFile:
    """A plan that was written once and will never change."""

    path: Path
    """Where it lies."""
    sha256: str
    """Hash of the file's bytes, 64 hexadecimal digits."""

    def verify(self) -> None:
        """Do nothing if the file is still what was written.

        Raises:
            FileFormatError: It is gone, unreadable, or its bytes have another hash.
        """
        try:
            found = hashlib.sha256(self.path.read_bytes()).hexdigest()
        except OSError as error:
            raise FileFormatError(
                f"cannot read the plan {self.path} ({error.strerror}); put the file back"
            ) from error
        if found != self.sha256:
            raise FileFormatError(
                f"{self.path} has SHA-256 {found[:12]}..., expected {self.sha256[:12]}...; plans "
                "never change: put the original back, or void the trial"
            )


def write_plan(
    plan: Plan,
    path: str | os.PathLike[str],
    *,
    format: PlanFileFormat | None = None,
    rate: float | None = None,
) -> PlanFile:
    """Write a plan, durable and read-only; the suffix gives the format unless `format` does.

    The same plan always gives the same bytes, and so the same hash.

    Args:
        plan: The plan.
        path: Where to; an existing file with the same content is kept, another one is an error.
        format: `npz` (t, q, dq, ddq), `csv`, or `json` in ROS 2 JointTrajectory's field order.
        rate: Samples a second; None writes the plan's own frames.

    Raises:
        ConfigurationError: An unknown format or suffix.
        FileFormatError: Another file is there already.
        InvalidPlanError: A rate that is not a positive number.
        WorkspaceError: The disk is full or the folder read-only; nothing is left behind.
    """
    path = Path(path)
    content = encode_plan(plan, check_plan_path(path, format=format, rate=rate), rate=rate)
    write_once(path, content)
    return PlanFile(path, hashlib.sha256(content).hexdigest())


def check_plan_path(
    path: Path, *, format: PlanFileFormat | None = None, rate: float | None = None
) -> PlanFileFormat:
    """Return the format that `write_plan` would write; nothing is written.

    Raises:
        ConfigurationError: An unknown format or suffix.
        InvalidPlanError: A rate that no plan can be sampled at.
        WorkspaceError: There is no folder to write to.
    """
    kind = format or path.suffix.lower().removeprefix(".")
    if kind not in get_args(PlanFileFormat):
        raise ConfigurationError(
            f"cannot write a plan as {kind or path.name!r}; end the name in .npz, .csv or .json, "
            "or say the format"
        )
    if rate is not None and not 0 < rate <= _HIGHEST_RATE:
        raise InvalidPlanError(
            f"rate must be a number of samples a second up to {_HIGHEST_RATE:g}, got {rate}"
        )
    if not path.parent.is_dir():
        raise WorkspaceError(f"cannot write {path}, there is no such folder; make the folder first")
    return cast(PlanFileFormat, kind)


def read_plan(path: str | os.PathLike[str], *, sha256: str | None = None) -> Plan:
    """Read an NPZ plan, and check its hash where one is given.

    Raises:
        FileFormatError: Missing, damaged, or not what the hash says.
        InvalidPlanError: It holds no plan that could be executed.
    """
    path = Path(path)
    if not path.is_file():
        raise FileFormatError(f"no plan at {path}; give the path of an .npz plan file")
    if sha256 is not None:
        PlanFile(path, sha256).verify()
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            q = np.array(archive["q"])
            metadata = json.loads(str(archive["metadata"]))
        if metadata["file_format"] != FILE_FORMAT or metadata["version"] != FILE_VERSION:
            raise ValueError(f"written as {metadata['file_format']} {metadata['version']}")
        names, units = tuple(metadata["joint_names"]), tuple(metadata["units"])
        return Plan(q, PlanFormat(names, units, float(metadata["dt"])))
    except PriorReinforceError:
        raise
    except (
        OSError,
        EOFError,
        ValueError,
        KeyError,
        TypeError,
        MemoryError,
        NotImplementedError,
        RuntimeError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise FileFormatError(
            f"{path} is not a plan file ({error}); write one with write_plan or `export`"
        ) from error


def run_with_plan(
    command: str, plan_file: PlanFile, *, time_limit: float, keep_open: tuple[int, ...] = ()
) -> HandOver:
    """Run `mycontroller {plan}` in a process of its own, once the plan's hash is checked.

    Args:
        command: Program and arguments, `{plan}` among them; no shell sees it.
        plan_file: What is to be executed.
        time_limit: In [s]; then the command and everything it started are stopped.
        keep_open: File descriptors that the command inherits.

    Raises:
        ConfigurationError: A command or a limit that cannot be used, or a program that cannot be
            started; nothing has run then.
        FileFormatError: The plan is no longer what its hash says; nothing has run.
    """
    plan_file.verify()
    return run_command(command, plan_file.path, time_limit=time_limit, keep_open=keep_open)
