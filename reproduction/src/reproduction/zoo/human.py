"""How people's demonstrations differ: one generator of human variation for all of the zoo.

A task has a base strategy: submovements (minimum-jerk strokes that may overlap) from a home
posture, with as many aims as an outcome has components. A demonstrator draws a manner (when to
start, how fast, how evenly, in what posture), and then aims: the aims are solved for in simulation,
in that manner, until the task's own rollout without disturbances comes near to the outcome that was
meant. So the outcomes spread over the region in every kind of set but `scattered`, and each is
exactly what its plan does. A manner in which nothing hits is drawn again.

A set is named `KIND-COUNT-SEED`, for instance `warped-8-2`; the same name gives the same set.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float
from numpy.linalg import norm
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Frames, Point, Points
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.interpolation import minimum_jerk
from prior_reinforce.plans.motions import Demonstrations
from reproduction.following import warped

if TYPE_CHECKING:
    from reproduction.zoo.base import ZooTask

_HUMAN_ERROR = 0.04
"""An outcome may be off what was meant by this part of the region's extent; ours."""
_MARGIN = 0.03
"""The outermost outcomes that are meant are this part of the region's extent inside it; ours."""
_CORRECTIONS, _NUDGE, _NEAR_ENOUGH = 8, 1e-3, 0.01
"""Corrections of an aim, each from the outcomes of aims that differ by a nudge (a part of their
range), until the outcome is as near as this part of the region; ours."""
_MOST_TRIES = 60
"""Manners drawn for one demonstration before it is given up; ours."""
_WARP_WAVES = 3
"""Sine waves that a time warp is made of; ours: a stroke is sped up and slowed down once or twice,
not shaken."""
_STEEPEST_WARP = 0.7
"""A warp changes the pace by at most this part; ours, so that time never stands."""


@dataclass(frozen=True)
class Submovement:
    """A minimum-jerk stroke; several may overlap, and add up."""

    start: float
    """In [s] from the motion's beginning."""
    duration: float
    """In [s]."""
    change: tuple[float, ...]
    """What it adds to each of the D channels."""
    by_hardware: bool = False
    """Whether its pace is the machine's: a gripper opens as fast in a slow throw as in a fast."""


@dataclass(frozen=True)
class Strategy:
    """One way of doing a task: a home posture and the submovements from it."""

    home: tuple[float, ...]
    """The D channels before the motion."""
    moves: tuple[Submovement, ...]
    """In order of their starts; the last one or two decide the outcome."""
    pause_at: float
    """Between its two phases, where a person may pause, in [s]."""
    settle: float = 0.0
    """Rest at the end that belongs to the motion: what is done early, for a person who aims at a
    time, in [s]."""

    @property
    def duration(self) -> float:
        """Duration of the motion, in [s]."""
        return max(move.start + move.duration for move in self.moves) + self.settle


def reach_and_strike(
    home: tuple[float, ...],
    wound: ArrayLike,
    struck: ArrayLike,
    reach: float,
    strike: float,
    overlap: float = 0.0,
    more: tuple[Submovement, ...] = (),
) -> Strategy:
    """The two phases that most strategies have: wind up, then strike.

    They take `reach` and `strike` seconds; the strike begins `overlap` before the reach ends.
    """
    there, onward = (tuple(np.subtract(*ends)) for ends in ((wound, home), (struck, wound)))
    begins = reach - overlap
    moves = (Submovement(0.0, reach, there), Submovement(begins, strike, onward), *more)
    return Strategy(home, moves, begins)


@dataclass(frozen=True)
class Variation:
    """How the demonstrations of a set differ; figures are ours, of the order that people have."""

    rest: tuple[float, float] = (0.5, 0.5)
    """Range of the rest after the motion, as part of the frames that the motion leaves free."""
    cut: tuple[float, float] = (0.0, 0.0)
    """Range of the part of the last stroke that is no longer recorded; the rest is then none."""
    tempo: float = 0.0
    """Standard deviation of the logarithm of the motion's duration."""
    warp: float = 0.0
    """Standard deviation of each wave's relative change of pace within the motion."""
    pause: float = 0.0
    """Longest pause between the two phases, as part of the motion's duration."""
    posture: float = 0.0
    """Standard deviation of a posture, in the task's own measures (`ZooTask.posture`)."""
    second_style: float = 0.0
    """Share of demonstrations in the task's other style."""
    outliers: int = 0
    """Demonstrations in the other style, an odd posture and another tempo, whatever else holds."""
    jitter: float = 0.0
    """Standard deviation of the encoders' noise on angles, in [rad]."""
    scattered: bool = False
    """Outcomes are meant at random; else far from each other."""


_ENCODER = 2e-5  # rad
_ODD_POSTURE, _ODD_TEMPO = 3.0, 0.85

_MIXED = Variation((0.1, 0.9), (0.0, 0.0), 0.08, 0.12, 0.15, 0.5, 0.0, 0, _ENCODER)
KINDS = {
    "clean": Variation(),
    "delayed": Variation(rest=(0.3, 0.7)),
    "tempo": Variation(tempo=0.12),
    "warped": Variation(warp=0.2),
    "paused": Variation(pause=0.3),
    "cut": Variation(rest=(0.0, 0.0), cut=(0.05, 0.3)),
    "short-rest": Variation(rest=(0.03, 0.97), tempo=0.05),
    "postures": Variation(posture=1.0),
    "styles": Variation(second_style=1 / 3),
    "outlier": Variation(outliers=1),
    "jitter": Variation(jitter=_ENCODER),
    "mixed": _MIXED,
    "scattered": replace(_MIXED, scattered=True),
    "ways": Variation((0.3, 0.7), tempo=0.05, posture=0.5, second_style=0.5, jitter=_ENCODER),
}
"""What each kind of set varies; `mixed` varies all that one person does, at about half the size,
and `scattered` also where it ends up. `ways` has as many demonstrations in each of two styles, in
no order, with some difference of start, tempo and posture."""

COUNTS = (3, 16)
"""Fewest and most demonstrations of a set that is made by name."""


@dataclass(frozen=True, eq=False)
class Manner:
    """How one demonstration is carried out, whatever it aims at."""

    rest: float
    cut: float
    tempo: float
    warp: Float[np.ndarray, " w"]
    pause: float
    posture: Float[np.ndarray, "2 D"]
    """Offsets of the channels: at home, and what is added to that in the first submovement."""
    style: int
    noise: Frames

    def path(self, task: ZooTask, aims: Point) -> Frames:
        """The channels that the person leads through, at the task's frames."""
        strategy = task.strategy(aims, self.style)
        pause = self.pause * strategy.duration
        moves = [
            replace(move, start=move.start + pause) if move.start >= strategy.pause_at else move
            for move in strategy.moves
        ]
        duration = strategy.duration + pause
        takes = self.tempo * duration
        whole = (task.horizon - 1) * task.format.dt
        free = max(whole - takes, 0.0)
        slack = free if task.slack is None else task.slack
        led = [move for move in moves if not move.by_hardware]
        lost = self.cut * self.tempo * led[-1].duration
        begins = max(whole - takes - self.rest * slack + lost, 0.0)

        times = np.arange(task.horizon) * task.format.dt
        part = np.clip((times - begins) / takes, 0.0, 1.0)
        phase = duration * warped(part, self.warp)
        fine = np.linspace(0.0, 1.0, 501)
        when = begins + takes * fine
        home, taken_up = self.posture
        path = np.tile(np.array(strategy.home) + home, (task.horizon, 1))
        for number, move in enumerate(moves):
            change = np.array(move.change) + (taken_up if number == 0 else 0.0)
            if move.by_hardware:
                start = np.interp(move.start, duration * warped(fine, self.warp), when)
                progress = (times - start) / move.duration
            else:
                progress = (phase - move.start) / move.duration
            path += minimum_jerk(progress)[:, None] * change
        return path + self.noise


def demonstrate(task: ZooTask, name: str) -> Demonstrations:
    """Make the set of a name.

    Raises:
        ConfigurationError: The name is not `KIND-COUNT-SEED`, or the task cannot be done so.
    """
    kind, *numbers = name.rsplit("-", 2)
    known = kind in KINDS and len(numbers) == 2 and all(n.isdecimal() for n in numbers)
    if not known or not COUNTS[0] <= int(numbers[0]) <= COUNTS[1]:
        raise ConfigurationError(
            f"{task.name} has no demonstration set {name!r}; write KIND-COUNT-SEED, for instance "
            f"clean-6-0, with {COUNTS[0]} to {COUNTS[1]} demonstrations of the kind "
            f"{', '.join(KINDS)}"
        )
    variation, count, seed = KINDS[kind], *map(int, numbers)
    rng = np.random.default_rng([seed, zlib.crc32(f"{task.name} {kind} {count}".encode())])
    styles = np.zeros(count, dtype=int)
    odd = rng.permutation(count)
    styles[odd[: round(variation.second_style * count)]] = 1
    outliers = {int(i) for i in odd[: variation.outliers]}
    made = [
        _attempt(task, variation, meant, int(styles[i]), i in outliers, rng)
        for i, meant in enumerate(_meant(task, variation, count, rng))
    ]
    plans, outcomes = map(np.array, zip(*made, strict=True))
    return Demonstrations(plans, outcomes, task.format, task.outcome_format)


def _meant(task: ZooTask, variation: Variation, count: int, rng: np.random.Generator) -> Points:
    """Outcomes to mean, up to the region's edges: at random, or each far from those before."""
    low, high = task.region
    shares = rng.uniform(size=(count if variation.scattered else 1, len(low)))
    while len(shares) < count:
        candidates = rng.uniform(size=(60, len(low)))
        apart = norm(candidates[:, None] - shares, axis=-1).min(axis=1)
        shares = np.vstack([shares, candidates[np.argmax(apart)]])
    least, most = shares.min(axis=0), shares.max(axis=0)
    shares = _MARGIN + (1.0 - 2.0 * _MARGIN) * (shares - least) / (most - least)
    return low + shares * (high - low)


def _attempt(
    task: ZooTask,
    variation: Variation,
    meant: Point,
    style: int,
    outlier: bool,
    rng: np.random.Generator,
) -> tuple[Frames, Point]:
    """A demonstration near the outcome that is meant: its plan, and its exact outcome."""
    for _ in range(_MOST_TRIES):
        manner = _draw(task, variation, style, outlier, rng)
        aims = _aim(task, manner, meant)
        plan = task.recorded(manner.path(task, aims))
        outcome = task.execute(plan)
        low, high = task.region
        if outcome is not None and np.all(np.abs(outcome - meant) <= _HUMAN_ERROR * (high - low)):
            return plan, outcome
    raise ConfigurationError(
        f"{task.name} cannot be demonstrated as {variation} near {meant.tolist()}; choose another "
        "seed or kind"
    )


def _draw(
    task: ZooTask, variation: Variation, style: int, outlier: bool, rng: np.random.Generator
) -> Manner:
    # One order whatever the kind, so that sets of one seed differ in nothing else.
    rest, cut, tempo, pause = rng.uniform(size=4)
    warp = variation.warp * rng.normal(size=_WARP_WAVES)
    warp *= min(1.0, _STEEPEST_WARP / max(float(np.abs(warp).sum()), 1e-9))
    # People come back to nearly the same home, and differ more in how they wind up.
    differs = np.array([[0.5], [1.0]]) * np.array(task.posture)
    posture = differs * rng.normal(size=differs.shape)
    noise = rng.normal(size=(task.horizon, len(task.posture)))
    return Manner(
        rest=float(variation.rest[0] + rest * np.ptp(variation.rest)),
        cut=float(variation.cut[0] + cut * np.ptp(variation.cut)),
        # Uniform with the stated standard deviation: nobody doubles the tempo by chance.
        tempo=float(np.exp(variation.tempo * np.sqrt(12) * (tempo - 0.5)))
        * (_ODD_TEMPO if outlier else 1.0),
        warp=warp,
        pause=float(variation.pause * pause),
        posture=posture * (_ODD_POSTURE if outlier else variation.posture),
        style=1 if outlier else style,
        noise=variation.jitter * noise * task.is_angle,
    )


def _aim(task: ZooTask, manner: Manner, meant: Point) -> Point:
    """The aims that bring the outcome, in this manner, nearest to the one that is meant."""
    extent = task.region[1] - task.region[0]
    k = len(extent)

    def miss(shares: Point) -> Point:
        outcome = task.execute(task.recorded(manner.path(task, task.aims(shares))))
        return np.full(k, 10.0) if outcome is None else (outcome - meant) / extent

    starts = [np.array(start) for start in product((0.2, 0.5, 0.8), repeat=k)]
    shares, off = min(((s, miss(s)) for s in starts), key=lambda found: norm(found[1]))
    for _ in range(_CORRECTIONS):
        if norm(off) < _NEAR_ENOUGH:
            break
        nudged = shares + _NUDGE * np.where(shares > 0.5, -1.0, 1.0) * np.eye(k)
        slopes = np.array([(miss(s) - off) / (s - shares).sum() for s in nudged]).T
        step = np.linalg.lstsq(slopes, -off, rcond=None)[0]
        for part in (1.0, 0.5, 0.25, 0.125):  # shorter where the full correction is too bold
            tried = np.clip(shares + part * step, 0.0, 1.0)
            outcome = miss(tried)
            if norm(outcome) < norm(off):
                shares, off = tried, outcome
                break
        else:
            break
    return task.aims(shares)
