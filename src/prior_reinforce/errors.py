"""Every error a caller can cause, in one tree, and how a caller is warned.

A message is one line that names the value, what was expected and the remedy; the command line
prints it as it stands and exits with status 2, or 1 if something was written before it.
"""

import sys
import warnings
from types import FrameType, NoneType
from typing import Any, Literal, get_args, get_origin


class PriorReinforceError(Exception):
    """Base of all errors that this package raises on purpose: a problem, and perhaps its remedy.

    The message joins both; who knows better what to do takes the `problem` alone.
    """

    changed = False
    """Whether something was written before; what then failed was another step of the same call."""

    def __init__(self, problem: str = "", *, remedy: str = "") -> None:
        self.problem, self.remedy = problem, remedy
        super().__init__(f"{problem}; {remedy}" if remedy else problem)


class InvalidPlanError(PriorReinforceError, ValueError):
    """A plan, or its format, has a wrong shape, unit, or a value that is not finite."""


class InvalidDemonstrationsError(PriorReinforceError, ValueError):
    """Demonstrations that cannot be learned from: too few, repeated, degenerate, or not finite."""


class InvalidGoalError(PriorReinforceError, ValueError):
    """A goal of the wrong dimension, or not finite."""


class InvalidFeedbackError(PriorReinforceError, ValueError):
    """A perceived error of the wrong shape, or not finite."""


class ConfigurationError(PriorReinforceError, ValueError):
    """A setting outside its range, or settings that contradict each other."""


class UnclearUnitsError(ConfigurationError):
    """Recorded units, times or names are not said, or cannot be what they would be taken for.

    `options` are the command-line options that say they are what they look like, and `also` is
    what else is wrong.
    """

    def __init__(self, problem: str, options: str, also: str = "") -> None:
        self.options, self.also = options, also
        more = f"; and {also}" if also else ""
        super().__init__(problem, remedy=f"if so, add: {options}{more}")


class UnclearFlangeError(ConfigurationError):
    """Which link of an arm's description is the flange is not clear; `proposed` may be it."""

    def __init__(self, message: str, proposed: str = "") -> None:
        self.proposed = proposed
        super().__init__(message)


class FileFormatError(PriorReinforceError, ValueError):
    """A file that is missing, truncated, or not of the format its name promises."""


class NotFittedError(PriorReinforceError, RuntimeError):
    """A generator or an adapter was used before `fit` or `start`."""


class TrialStateError(PriorReinforceError, RuntimeError):
    """A trial was told, voided or amended in a state that does not allow it."""


class PerceptionFailedError(PriorReinforceError, RuntimeError):
    """Perception gives no number; an operator has to be asked instead of inventing one."""


class EndpointError(PerceptionFailedError):
    """The endpoint of a model does not answer, or refuses; no picture is to blame."""


class RenderingUnavailableError(PriorReinforceError, RuntimeError):
    """This machine has no OpenGL to draw with; the remedy is in the message."""


class MissingExtraError(PriorReinforceError, ImportError):
    """An optional dependency is not installed; the message names the extra to install."""


class OutOfReachError(PriorReinforceError, ValueError):
    """A goal asks for a motion that the arm's kinematics cannot make, or that a limit forbids."""


class RobotLimitError(PriorReinforceError, ValueError):
    """A plan breaks a limit of the robot; the report names the joint, the time and the margin."""


class WorkspaceError(PriorReinforceError, RuntimeError):
    """A task folder on disk is missing, incomplete, locked, or inconsistent with its journal."""


def warn_caller(message: str) -> None:
    """Warn of the line outside this package that led here, through however many calls."""
    frame: FrameType | None = sys._getframe()
    level, package = 1, __name__.partition(".")[0]
    # By module, since a data class's own `__init__` has no file.
    while frame and str(frame.f_globals.get("__name__")).partition(".")[0] == package:
        frame, level = frame.f_back, level + 1
    warnings.warn(message, stacklevel=level)


def one_of(hint: Any) -> str:
    """The remedy for a value that is none of a `Literal`; empty where another kind may stand."""
    alternatives = (hint,) if get_origin(hint) is Literal else get_args(hint)
    kinds = [kind for kind in alternatives if kind not in (NoneType, ...)]
    if not kinds or any(get_origin(kind) is not Literal for kind in kinds):
        return ""
    return f"; use one of {', '.join(str(value) for kind in kinds for value in get_args(kind))}"
