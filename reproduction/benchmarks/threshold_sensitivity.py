"""What generated plans owe to each threshold whose value nothing fixes: halve it, and double it.

    python reproduction/benchmarks/threshold_sensitivity.py [--sets 3] [--goals 10] [--seed 0] \
        [--minutes 60]
        [--kinds KIND-COUNT ...] [--only NAME ...] [--part 0/1]

`auto` is fitted to sets of the zoo's development tasks with one threshold changed at a time. A row
a threshold: for its half and for its double, how many sets generate other plans than with its value
(by more than 1e-9 of a channel's range), the largest such difference in ranges, and the share of
first throws that hit, less that with its value, with its standard error over all sets. Thresholds
of the codec, which no closed form uses, change demonstrations that are coded and decoded instead:
the share that still reaches its own outcome. Integers are halved upwards. No network is trained.

Two kinds of sets are the zoo's with a change: `few-...` are recorded in 16 frames, `noisy-...` with
0.3 mrad or mm of noise, and a joint that is held. The sets that fit into the minutes count; `--part
0/2` and `1/2` share them between two processes, whose rows `--save` keeps.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import time
import warnings
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.generators import make_generator
from prior_reinforce.generators.network.codec import PlanCodec
from prior_reinforce.generators.network.config import DiffusionConfig
from prior_reinforce.generators.timing import registration, timeline
from prior_reinforce.generators.timing.events import find_transitions
from prior_reinforce.plans.signals import analyse, without_noise
from prior_reinforce.plans.speeds import SMOOTHING, velocity_profiles
from prior_reinforce.simulation.protocol import is_hit
from prior_reinforce.simulation.tasks import make_task
from reproduction.zoo import DEVELOPED_ON

THRESHOLDS = (
    "generators.timing.registration.CONVERGED",
    "generators.timing.registration._NEWTON_STEPS",
    "generators.timing.registration._LARGEST_SHIFT",
    "generators.timing.registration._COMPARED",
    "generators.timing.registration._FINE",
    "plans.signals._MAX_LEVELS",
    "plans.signals._ACTIVE",
    "plans.signals._STEP_SHARE",
    "plans.signals._FEWEST_FRAMES",
    "plans.signals._STANDS_OUT",
    "plans.signals._NOISE_PEAK",
    "plans.signals._POSE_SHARE",
    "plans.signals.END_STEP",
    "generators.timing.extrapolation.END_SPEED",
    "generators.timing.extrapolation._SLOPE_FRAMES",
    "generators.timing.timeline._OVERSAMPLING",
    "generators.network.codec._SPLINE_FOLDS",
    "generators.network.codec._MOST_NOISE",
    "generators.patterns._MAX_UNEXPLAINED",
    "generators.timing.evidence._MAX_USEFUL_ERROR",
    "generators.timing.evidence._FEWEST",
    "generators.timing.evidence._BEST",
    "generators.timing.evidence._RIDGE",
    "generators.timing.evidence._EQUALLY_GOOD",
)
OF_TEMPOS = ("generators.timing.registration._COMPARED",)
OF_THE_CODEC = ("plans.signals.END_STEP", "generators.network.codec.")
KINDS = ("mixed-8", "tempo-6", "noisy-paused-6", "cut-6", "few-mixed-6", "jitter-4", "scattered-8")
FRAMES = 16
NOISE = 3e-4


@dataclass(frozen=True)
class Case:
    """A set of demonstrations, and goals."""

    task: Any
    demonstrations: Any
    goals: NDArray[np.float64]

    @classmethod
    def make(cls, task: Any, kind: str, number: int, n_goals: int) -> Case:
        """The set of a kind, with the change that the kind names."""
        change, _, rest = kind.partition("-")
        name = f"{rest if change in ('few', 'noisy') else kind}-{number}"
        demonstrations = task.demonstrations(name).without_symmetry()
        plans, rng = demonstrations.plans, np.random.default_rng([8, number])
        form = demonstrations.format
        if change == "few":
            plans = resampled(plans, FRAMES)
            seconds = form.dt * (task.horizon - 1)
            form = replace(form, dt=seconds / (FRAMES - 1))
            demonstrations = demonstrations.with_plans(plans, form)
        elif change == "noisy":
            held = np.full((*plans.shape[:2], 1), 0.3)
            plans = np.concatenate([plans, held], axis=2)
            units = (*form.units, "rad")
            measured = np.array([unit in ("rad", "m") for unit in units])
            plans = plans + NOISE * measured * rng.normal(size=plans.shape)
            form = replace(form, names=(*form.names, "held"), units=units)
            demonstrations = demonstrations.with_plans(plans, form)
        return cls(
            task, demonstrations, task.sample_goals(n_goals, np.random.default_rng([7, number]))
        )

    def forget(self) -> None:
        """Analyse and decompose the demonstrations anew."""
        self.demonstrations.__dict__.pop("signals", None)
        timeline.decompose.cache_clear()

    def plans(self, seed: int) -> NDArray[np.float64]:
        """For the goals, with the thresholds as they are now."""
        return make_generator("auto").fit(self.demonstrations, seed=seed).generate(self.goals)

    def coded(self) -> NDArray[np.float64]:
        """The demonstrations coded and decoded as a network's default has it."""
        config = DiffusionConfig()
        codec = PlanCodec.fit(
            self.demonstrations,
            representation=config.representation,
            frames_per_point=config.frames_per_point,
            length_multiple=config.network.length_multiple,
            margin=config.margin,
        )
        return codec.decode(codec.encode(self.demonstrations.plans))

    def hits(
        self, plans: NDArray[np.float64], goals: NDArray[np.float64], seed: int | None
    ) -> float:
        """Share of the goals that these plans hit."""
        plans = plans[:, :, : self.task.format.action_dim]
        if plans.shape[1] == FRAMES:
            plans = resampled(plans, self.task.horizon)
        rng = None if seed is None else np.random.default_rng(seed)
        thrown = self.task.rollout(plans, rng)
        hits = [is_hit(r, g, self.task.tolerance) for r, g in zip(thrown, goals, strict=True)]
        return float(np.mean(hits))

    def off(self, one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
        """How much plans differ at most, in the channels' ranges."""
        ranges = np.ptp(self.demonstrations.plans, axis=(0, 1))
        off = np.abs(one - other).max(axis=(0, 1))
        return float(np.max(off / np.where(ranges > 0, ranges, 1.0)))


def resampled(plans: NDArray[np.float64], frames: int) -> NDArray[np.float64]:
    """Plans of as many frames, over the same time."""
    spline = make_interp_spline(np.linspace(0.0, 1.0, plans.shape[1]), plans, k=3, axis=1)
    return np.asarray(spline(np.linspace(0.0, 1.0, frames)))


def changed(value: Any, factor: float) -> Any:
    """A threshold times a factor."""
    if isinstance(value, tuple):  # ways to sample: only the coarsest, or finer ones as well
        return value[:1] if factor < 1 else (*value, 2 * value[-1])
    return math.ceil(value * factor) if isinstance(value, int) else value * factor


def measure(case: Case, names: list[str], seed: int) -> dict[str, Any]:
    """For each threshold and factor: the largest difference of plans, and of the share of hits."""
    coded, plans = case.coded(), case.plans(seed)
    reached = case.hits(coded, case.demonstrations.outcomes_seen, None)
    hits = case.hits(plans, case.goals, seed)
    found: dict[str, Any] = {"": (hits, reached)}
    usual = {name: first_step(case, name) for name in (".signals.", ".registration.")}
    for name in names:
        module_name, _, attribute = name.rpartition(".")
        module = importlib.import_module(f"prior_reinforce.{module_name}")
        value = getattr(module, attribute)
        for factor in (0.5, 2.0):
            setattr(module, attribute, changed(value, factor))
            if not module_name.startswith("generators"):
                case.forget()
            if name.startswith(OF_THE_CODEC):
                new = case.coded()
                off, gain = case.off(new, coded), 0.0
                if off > 1e-9:
                    gain = case.hits(new, case.demonstrations.outcomes_seen, None) - reached
            elif name not in OF_TEMPOS and any(
                stage in name and first_step(case, name) == usual[stage] for stage in usual
            ):
                off, gain = 0.0, 0.0
            else:
                new = case.plans(seed)
                off, gain = case.off(new, plans), 0.0
                if off > 1e-9:
                    gain = case.hits(new, case.goals, seed) - hits
            found[f"{name} {factor:g}"] = (off, gain)
            setattr(module, attribute, value)
        if not module_name.startswith("generators"):
            case.forget()
    return found


def first_step(case: Case, name: str) -> list[bytes]:
    """What a threshold of signals or of registration decides first; equal if plans will be."""
    demonstrations = case.demonstrations
    signals = analyse(demonstrations.plans, demonstrations.format.units, demonstrations.format.dt)
    plans = without_noise(demonstrations.plans, signals.held)
    came = find_transitions(plans, signals)
    if ".signals." in name:
        arrays = [np.asarray(getattr(signals, field.name)) for field in fields(signals)]
        return [a.tobytes() for a in (*arrays, np.array(list(came)), *came.values())]
    units = demonstrations.format.units
    smooth = [d for d in range(len(units)) if d not in came]
    profiles = velocity_profiles(
        plans[:, :, smooth], [units[d] for d in smooth], SMOOTHING / demonstrations.format.dt
    )
    try:
        found = [registration.Motions(np.stack(profiles), None).register("start")[0]]
    except InvalidDemonstrationsError:
        return []
    return [each.tobytes() for each in (*found, registration.correlation_lags(np.stack(profiles)))]


def show(rows: list[dict[str, Any]], names: list[str]) -> None:
    """Print the table."""
    hits, reached = np.mean([row[""] for row in rows], axis=0)
    print(f"{len(rows)} sets; first throws that hit {hits:.3f}; coded and decoded {reached:.3f}\n")
    print("| threshold | half: sets | largest | first throws | double: sets | largest | |")
    print("|---|---|---|---|---|---|---|")
    for name in names:
        cells = []
        for factor in ("0.5", "2"):
            off, gain = np.array([row[f"{name} {factor}"] for row in rows]).T
            differ = int(np.sum(off > 1e-9))
            error = np.std(gain) / np.sqrt(len(rows))
            effect = [f"{off.max():.1e}", f"{gain.mean():+.3f} ± {error:.3f}"]
            cells += [str(differ), *(effect if differ else ["", ""])]
        print(f"| `{name}` | {' | '.join(cells)} |", flush=True)


def main() -> None:
    """Measure as many sets as there is time for, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="+", default=KINDS)
    parser.add_argument("--only", nargs="+", default=THRESHOLDS)
    parser.add_argument("--sets", type=int, default=3)
    parser.add_argument("--goals", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--part", default="0/1")
    parser.add_argument("--save", type=Path)
    parser.add_argument("--show", type=Path, nargs="+", help="saved rows, in place of a run")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    rows: list[dict[str, Any]] = []
    if arguments.show:
        for path in arguments.show:
            rows += [json.loads(line) for line in path.read_text().splitlines()]
        show(rows, arguments.only)
        return
    began = time.monotonic()
    part, parts = map(int, arguments.part.split("/"))
    sets = [
        (DEVELOPED_ON[(place + kind) % len(DEVELOPED_ON)], arguments.kinds[kind], number)
        for number in range(arguments.sets)
        for place in range(len(DEVELOPED_ON))
        for kind in range(len(arguments.kinds))
    ]  # every kind comes early, on other tasks each time
    for name, kind, number in sets[part::parts]:
        if time.monotonic() - began > 60 * arguments.minutes:
            break
        case = Case.make(make_task(name), kind, number, arguments.goals)
        rows.append(measure(case, arguments.only, arguments.seed))
        if arguments.save:
            with arguments.save.open("a") as file:
                file.write(json.dumps({"set": f"{name} {kind}-{number}", **rows[-1]}) + "\n")
    show(rows, arguments.only)


if __name__ == "__main__":
    main()
