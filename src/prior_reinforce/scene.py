"""What to look for in a picture of the table, and in which plane it lies."""

from __future__ import annotations

from dataclasses import dataclass

from prior_reinforce.errors import ConfigurationError

# Nine places around a 1 m x 1 m table whose near edge is 0.35 m from the robot's base axis (ours):
# four would do, nine also tell how good the calibration is.
_TABLE_MARKS = tuple((x, y) for x in (0.5, 0.85, 1.2) for y in (-0.4, 0.0, 0.4))


@dataclass(frozen=True)
class SeenObject:
    """An object in words that a model understands."""

    words: str
    """For instance `the orange ball`; only one thing in the picture answers to it."""
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


# The outcome is where the ball's centre comes down through the rim's plane, 10 cm up.
_BALL_AND_HOOP = TableScene(
    SeenObject("the orange ball", 0.06), SeenObject("the red hoop", 0.10), plane_height=0.10
)

SCENES: dict[str, TableScene] = {
    "basketball-v1": _BALL_AND_HOOP,
    "basketball-v2": _BALL_AND_HOOP,  # only the spoon is another
    # A ball of 5 cm and a white cup; its rim is as high as the hoop and 8.3 cm wide.
    "basketball-v3": TableScene(
        SeenObject("the orange ball", 0.05),
        SeenObject("the red rim of the cup", 0.083),
        plane_height=0.10,
    ),
    # Both stones lie on the table and are 3 cm high; the goal is 8 cm before the target stone.
    "curling": TableScene(
        SeenObject("the curling stone with the blue handle", 0.06),
        SeenObject("the curling stone with the red handle", 0.06),
        plane_height=0.02,
        goal_offset=(-0.08, 0.0),
    ),
    # The hook is a bead of 12 mm that touches the table; the magnet lies on a disc of 2 cm.
    "fishing": TableScene(
        SeenObject("the red hook", 0.012), SeenObject("the yellow disc", 0.02), plane_height=0.003
    ),
}
"""The paper's tasks by name; for a task of your own construct a `TableScene`."""


def scene_of(task_name: str) -> TableScene:
    """Return what to look for in one of the paper's tasks.

    Raises:
        ConfigurationError: There is no such task.
    """
    if task_name not in SCENES:
        raise ConfigurationError(
            f"no scene is described for task '{task_name}', only for {', '.join(SCENES)}; "
            "construct a TableScene with your objects' names"
        )
    return SCENES[task_name]
