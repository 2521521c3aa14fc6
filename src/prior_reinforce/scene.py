"""What to look for in a picture of the table, and in which plane it lies."""

from __future__ import annotations

from dataclasses import dataclass

from prior_reinforce.errors import ConfigurationError

# Nine places around a 1 m x 1 m table whose near edge is 0.35 m from the robot's base axis (ours):
# four would do, nine also tell how good the calibration is.
_TABLE_MARKS = tuple((x, y) for x in (0.5, 0.85, 1.2) for y in (-0.4, 0.0, 0.4))


@dataclass(frozen=True)
class SeenObject:
    """An object, in words that a model understands."""

    words: str
    """For instance `the orange ball`; they must fit one thing in the picture only."""
    size: float
    """Longer side of a box around it, in [m]. A box of less than half of it, or more than twice,
    is not around this object, however often the model repeats it."""

    def __post_init__(self) -> None:
        if not (self.words.strip() and self.size > 0):
            raise ConfigurationError(
                f"object '{self.words}' of {self.size} m cannot be looked for; give it words and "
                "its size in metres"
            )


@dataclass(frozen=True)
class TableScene:
    """The two objects whose centres tell the error.

    The error seen is the reached object's centre minus the goal; the goal is the goal object's
    centre plus `goal_offset`.
    """

    reached: SeenObject
    """The object whose place is the outcome."""
    goal: SeenObject
    """The object that stands at the goal."""
    plane_height: float
    """Height above the table of the plane in which both centres lie at the key frame, in [m]."""
    goal_offset: tuple[float, float] = (0.0, 0.0)
    """From the centre of the goal's object to the goal, (x, y) in the table frame, in [m]."""
    marks: tuple[tuple[float, float], ...] = _TABLE_MARKS
    """Known points (x, y) of that plane to calibrate the camera on, table frame, in [m]."""
