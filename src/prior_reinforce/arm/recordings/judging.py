"""Judge the units of the selected channels: believe, doubt, ask.

A channel is in its stated unit, else in the plan's. Rules doubt that by its name and its largest
number; the first that applies names the likely unit. A unit that nobody stated is asked about; a
stated one is believed where an arm can do it, with a remark.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from prior_reinforce.arm.recordings.naming import vectors
from prior_reinforce.arm.recordings.recording import Positions, Recording
from prior_reinforce.arm.recordings.units import Ambiguity, is_possible, judge_unit, say_names
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.channels import RATES, Kind, kinds
from prior_reinforce.plans.plan_format import PlanFormat, summed
from prior_reinforce.plans.whole_turns import TURN
from prior_reinforce.units import base_of

UNIT = "UNIT"
"""What stands for a unit that only the user knows, in an option to complete."""
Given = Literal["", "one for all", "each"]
"""How --units gives the recorded units; empty where it does not."""
_MOST_PERCENT = 110.0
"""Percent of a range; ours: calibrations overshoot by a few."""
_HARDLY_DEG, _STILL_DEG = 2.0, 0.1
"""Degrees within which a recorded arm hardly moves, and within which a joint is still. Ours."""
_EXACT, _SCALED = 1e-6, 1e-3
"""Tolerance of the ends of normalised numbers, in single precision, and of their mean and
deviation. Ours."""
_BELOW_0 = 0.5
"""Part of its largest number, or of 1, by which an opening is below 0. Ours: zeros are a little
off."""
_OF_COUNTS = " ('{:.2g} deg' for {} counts a turn, their middle subtracted in the file)"
_OF_OPEN = " (100 over its number when fully open: '0.1 percent' if its range is 0 to 1000)"
_NORMALISED = (
    "and all fill -1 to 1 to the last digit, or have a mean of 0 and a deviation of 1, as what was "
    "normalised does (then write it as it was before; say rad if they are angles)"
)
_BELOW = "and goes below 0, which no opening does (then write 0 where it is closed)"
_NOT_DONE, _HARDLY = "which no arm does", "which is hardly a motion"
_SHARES = (
    "LeRobot recorded shares of each joint's range (-100 to 100, or 0 to 100, where use_degrees is "
    "unset): those are no angles; record with use_degrees, or import them with --units percent "
    "into a workspace made by: prior-reinforce new W --robot none"
)


@dataclass(frozen=True, eq=False)
class Belief:
    """What is believed of one channel."""

    name: str
    kind: Kind
    stated: str | None
    """Unit that --units gives, or a file states; None where nobody does."""
    wanted: str
    """Unit in the plan."""
    reach: Mapping[str, float]
    """Largest number of each take, by its name."""
    ends: tuple[float, float] = (0.0, 0.0)
    """Least and greatest number of all takes."""
    normal: bool = False
    """Whether its numbers are as those that were brought into a range, or to a mean of 0."""

    @property
    def unit(self) -> str:
        """Unit that it is taken to be in."""
        return self.stated or self.wanted

    @cached_property
    def largest(self) -> float:
        """Largest number of all takes."""
        return max(self.reach.values())

    @property
    def where(self) -> str:
        """Which channel of which take has that number: `elbow of throw_2`."""
        return f"{self.name} of {max(self.reach, key=lambda take: self.reach[take])}"

    def without(self, takes: Collection[str]) -> Belief:
        """Return what is believed by the other takes; of all if there are no others."""
        kept = {take: most for take, most in self.reach.items() if take not in takes}
        return replace(self, reach=kept or self.reach)


class Doubt(NamedTuple):
    """What makes a unit doubtful."""

    looks: str
    """Unit that the numbers look like; `UNIT` where that cannot be said."""
    why: str
    """What speaks against the unit as it is believed: a clause."""
    asked: bool = False
    """Whether it is asked about even where somebody stated the unit."""


def beliefs_of(
    recordings: Sequence[Recording],
    names: Sequence[str],
    stated: Sequence[str | None],
    plan_units: Sequence[str] | None,
) -> list[Belief]:
    """Return what is believed of each channel, whose plan is in its base unit if nobody says."""
    pairs = zip(stated, kinds(names), strict=True)
    units = plan_units or [unit or kind.usual_unit(0.0) for unit, kind in pairs]
    form = PlanFormat(tuple(names), tuple(units), 1.0)
    poses = [summed(r.positions, form.increments) for r in recordings]  # what increments lead to
    reach = np.array([np.abs(pose).max(axis=0) for pose in poses])
    takes = [r.episode for r in recordings]
    every = np.concatenate([r.positions for r in recordings])
    normal = _are_normal(every).tolist()
    ends = list(zip(every.min(axis=0).tolist(), every.max(axis=0).tolist(), strict=True))
    beliefs = []
    for i, (name, kind, said) in enumerate(zip(names, kinds(names), stated, strict=True)):
        usual = base_of(said or kind.usual_unit(reach[:, i].max()))[0]
        wanted = plan_units[i] if plan_units else usual
        own = dict(zip(takes, reach[:, i].tolist(), strict=True))
        beliefs.append(Belief(name, kind, said, wanted, own, ends[i], normal[i]))
    return beliefs


def _are_normal(every: Positions) -> np.ndarray:
    """Whether channels go from exactly -1 to 1, or have a mean of 0 and a deviation of 1."""
    in_range = (np.abs(every.min(axis=0) + 1) < _EXACT) & (np.abs(every.max(axis=0) - 1) < _EXACT)
    scaled = np.hypot(every.mean(axis=0), every.std(axis=0) - 1) < _SCALED
    return np.asarray(in_range | scaled)


@dataclass(frozen=True, eq=False)
class Judge:
    """The rules that doubt what is believed of a recording's channels."""

    beliefs: Sequence[Belief]
    given: Given
    silent: bool
    """Whether no file states a unit."""
    fixed: bool
    """Whether the plan says its units."""
    normalised: bool
    """Whether the recorder also writes shares of each joint's range: -100 to 100, or 0 to 100."""

    @cached_property
    def angles(self) -> list[Belief]:
        """Channels that are believed to be angles."""
        return [one for one in self.beliefs if one.unit in TURN and one.kind is not Kind.TOOL]

    @cached_property
    def places(self) -> list[Belief]:
        """Coordinates, which are all in one unit."""
        lengths = (Kind.PLACE, Kind.LENGTH)
        return [one for one in self.beliefs if one.unit == "m" and one.kind in lengths]

    @cached_property
    def far(self) -> list[Belief]:
        """Angles that look like degrees, not radians, with all or with those numbered like them."""
        far = [one for one in self.angles if self._looks(one) not in (one.unit, None)]
        near = max((one.largest for one in self.angles if one not in far), default=0.0)
        together = self.fixed or self.given or 2 * len(far) > len(self.angles)
        if self._counts_turns(far):
            return far
        if far and (together or near > TURN["rad"]):
            return self.angles
        numbered = [group for group in self._numbered if not {*far}.isdisjoint(group)]
        alike = {one for group in numbered for one in group}
        return [one for one in self.angles if one in far or one in alike]

    @cached_property
    def _numbered(self) -> list[list[Belief]]:
        """Groups of channels that are numbered alike."""
        groups = vectors([one.name for one in self.beliefs]).values()
        return [[self.beliefs[i] for i in group] for group in groups]

    @cached_property
    def _slides(self) -> list[Belief]:
        """Channels that may slide: by their names, and in degrees the third joint of four."""
        arms = [arm for arm in self._numbered if [a.kind for a in arm] == [Kind.ANGLE] * 4]
        scara = [arm[2] for arm in arms if arm[2] in self.far or arm[2].stated == "deg"]
        return [one for one in self.beliefs if one.kind is Kind.SLIDE] + scara

    def _counts_turns(self, far: Sequence[Belief]) -> bool:
        """Whether one joint of the robot is beyond a turn, and in degrees others hardly move."""
        others = [one.largest for one in self.angles if one not in far]
        one_of_many = self.fixed and not self.given and len(far) == 1 and len(others) > 1
        return one_of_many and 0 < max(others) < _HARDLY_DEG

    def _looks(self, one: Belief) -> str | None:
        """The unit that a channel's numbers look like."""
        alike = self.places if one in self.places else [one]
        if one.kind in RATES:  # `vel_1_cmd`, `vel_2_cmd` are of one recorder
            called = [re.sub(r"\d+", "0", each.name) for each in self.beliefs]
            mine = re.sub(r"\d+", "0", one.name), one.stated
            alike = [e for e, n in zip(self.beliefs, called, strict=True) if (n, e.stated) == mine]
        most = max(each.largest for each in alike)
        looks = judge_unit(one.unit, most, opening=one.kind is Kind.TOOL)
        return "mm" if looks == "cm" != one.unit else looks  # cm are people's; machines log mm

    @cached_property
    def _normalised(self) -> list[Belief]:
        """Angles without a unit that were normalised: two or more, and most of those that move."""
        moving = [one for one in self.angles if one.ends[0] < one.ends[1]]
        normal = [one for one in moving if one.normal and one.stated is None]
        return normal if 2 * len(normal) > len(moving) > 1 else []

    def _is_normalised(self, one: Belief) -> Doubt | None:
        """Numbers that fill a range exactly in channel after channel were normalised."""
        return Doubt(UNIT, _NORMALISED) if one in self._normalised else None

    def _is_below(self, one: Belief) -> Doubt | None:
        """A share of an opening is never below 0: -1 is an end of a range that is -1 to 1."""
        is_share = one.kind is Kind.TOOL and one.unit == "percent" and one.stated is None
        below = is_share and one.ends[0] <= -_BELOW_0 * max(one.largest, 1)
        return Doubt(UNIT, _BELOW) if below else None

    def _may_slide(self, one: Belief) -> Doubt | None:
        """A rail or a SCARA's third axis is not in degrees only for being among angles that are."""
        among = one in self.far
        if self.given:
            among = self.given == "one for all" and self.silent
        slides = one in self._slides and one.unit in TURN and one.largest > 0
        why = "and its name leaves open if it turns or slides"
        return Doubt(UNIT, why, asked=True) if slides and among and not self.fixed else None

    def _is_no_angle(self, one: Belief) -> Doubt | None:
        """What turns too far is none: a gripper, or a name without meaning beside joints."""
        beside = one in self.far and len(self.far) < len(self.angles)
        unnamed = beside and not self.fixed and one.kind not in (Kind.ANGLE, Kind.ROTATION)
        none = one.kind is Kind.TOOL or unnamed
        if one.stated or one.unit not in TURN or not none or self._looks(one) == one.unit:
            return None
        why = f"beside joints in {one.unit}" if beside else "by its name"
        return Doubt("percent" if one.largest <= 100 else UNIT, f"and {why} it is no angle")

    def _hardly_moves(self, one: Belief) -> Doubt | None:
        """Joints that are said to be in degrees are not where all stay, or one does, within few."""
        said = self.given == "one for all" and self.silent
        most = TURN["rad"] if said else TURN["rad"] / 2 * (not self.places)
        small = all(angle.stated == "deg" and angle.largest < most for angle in self.angles)
        alone = said and one.stated == "deg" and _STILL_DEG < one.largest < _HARDLY_DEG
        doubted = (small or alone) and one in self.angles
        return Doubt("rad", _HARDLY, asked=said and small) if doubted else None

    def _is_beyond(self, one: Belief) -> Doubt | None:
        """A number beyond what arms do is in another unit; an angle with those that share it."""
        looks, why = self._looks(one), _NOT_DONE
        if one in self.far and self._is_of_no_unit(self.far):
            return Doubt(UNIT, why)
        if looks == one.unit:
            return Doubt("deg", why) if one in self.far and looks != "deg" else None
        if one in self.far and self._counts_turns(self.far):
            return Doubt(UNIT, "which is rad if it counts turns, deg if the others are still")
        if one.unit == "mm":  # hardly open
            why = _HARDLY
        if one.unit == "percent":
            why = _HARDLY if one.largest <= 100 else "which no share of a range does"
            if self.given and self.silent and one.stated and one.largest > _MOST_PERCENT:
                raise ConfigurationError(
                    f"{one.where} reaches {one.largest:.4g}, and --units says percent, of which a "
                    "range has 100: say its own unit, or counts for a number without a unit"
                )
        return Doubt(looks or UNIT, why)

    def _is_of_no_unit(self, alike: Sequence[Belief]) -> bool:
        """Whether most that share a unit are beyond all units: so no other is in degrees."""
        return 2 * sum(self._looks(one) is None for one in alike) > len(alike)

    @cached_property
    def _one_option(self) -> bool:
        """Whether --units could give one unit for all that have one, and contradicts no file."""
        pure = (Kind.QUATERNION, Kind.MATRIX)
        units = {one.unit for one in self.beliefs if one.stated or one.kind not in pure}
        return self.silent and len(units) == 1

    @cached_property
    def _doubts(self) -> dict[Belief, Doubt]:
        """Every doubt, by the first rule, asked about if nobody stated the unit, or a wrong one."""
        rules = (
            self._is_normalised, self._is_below, self._may_slide, self._is_no_angle,
            self._hardly_moves, self._is_beyond,
        )  # fmt: skip
        doubts = {}
        for one in self.beliefs:
            if doubt := next(filter(None, (rule(one) for rule in rules)), None):
                alike = self.far if one in self.far else [one]
                possible = all(is_possible(one.unit, each.largest) for each in alike)
                wrong = bool(self.given) and self._one_option and not possible
                asked = one.stated is None or doubt.asked or (wrong and doubt.looks != UNIT)
                doubts[one] = doubt._replace(asked=asked)
        return doubts

    @cached_property
    def _answers(self) -> dict[Belief, str]:
        """Unit of each channel, as it looks where that is asked about."""
        asked = {one: doubt.looks for one, doubt in self._doubts.items() if doubt.asked}
        return {one: asked.get(one, one.unit) for one in self.beliefs}

    def recorded(self) -> list[str]:
        """Unit of each channel; the plan's where its own cannot be told, or is of another kind."""
        return [
            unit
            if unit != UNIT and (one.stated or base_of(unit)[0] == base_of(one.wanted)[0])
            else one.wanted
            for one, unit in self._answers.items()
        ]

    def _groups(self, *, asked: bool) -> Iterator[tuple[str, Doubt, list[Belief], Belief]]:
        """Channels whose units are doubted alike, and of these the one with the largest number."""
        groups: dict[tuple[str, Doubt], list[Belief]] = {}
        for one, doubt in self._doubts.items():
            if doubt.asked == asked:
                groups.setdefault((one.unit, doubt), []).append(one)
        for (unit, doubt), among in groups.items():
            yield unit, doubt, among, max(among, key=lambda one: one.largest)

    @cached_property
    def _may_be_shares(self) -> bool:
        """Whether what looks like degrees may as well be shares of each joint's range."""
        return self.normalised and all(angle.largest <= _MOST_PERCENT for angle in self.angles)

    def questions(self) -> list[Ambiguity]:
        """Ask about units, one question for what looks alike, all with one option."""
        asked = {one for one, doubt in self._doubts.items() if doubt.asked}
        unsure = {one for one in asked if self._may_be_shares and self._answers[one] == "deg"}
        units = [UNIT if one in unsure else unit for one, unit in self._answers.items()]
        option = _option(units)
        by = ", as --units says," if self.given else ""
        questions = []
        for unit, doubt, among, worst in self._groups(asked=True):
            seen = f"it looks like {doubt.looks}"
            if doubt.looks == UNIT:
                seen = f"put its unit in the place of {UNIT}"
                seen += _OF_OPEN * (unit == "percent")
                if unit in TURN and worst not in self._slides and worst.largest > TURN["rad"]:
                    of_turn = 4096 if worst.largest <= 2 * 4096 else 65536
                    seen += _OF_COUNTS.format(TURN["deg"] / of_turn, of_turn)
            elif worst in unsure:
                seen = f"put deg in the place of {UNIT}, unless {_SHARES}"
            what = (
                f"{say_names([one.name for one in among])} in {unit}{by} would reach "
                f"{worst.largest:.4g} ({worst.where}), {doubt.why}: {seen}"
            )
            questions.append(Ambiguity(what, option, UNIT not in units))
        return questions

    def remarks(self) -> tuple[list[str], str]:
        """Remark on doubtful units that somebody stated; with the option for another, if any."""
        remarks, other = [], ""
        for unit, (looks, why, _), among, worst in self._groups(asked=False):
            if looks != UNIT:
                units = [looks if one in among else one.unit for one in self.beliefs]
                other = _option(units) if self._one_option else ""
                said = f"if it was recorded in {looks}, say {other}" if other else "check its unit"
                why = f"{why} (in {looks} it is one)" if why == _HARDLY else "and arms do not"
                remarks.append(f"{worst.where} reaches {worst.largest:.4g} {unit}, {why}: {said}")
        degrees = bool(self.angles) and {*map(self._answers.get, self.angles)} == {"deg"}
        if self.given and degrees and self._may_be_shares and not self.questions():
            remarks.append(f"degrees, as --units says, unless {_SHARES}")
        return remarks, other


def _option(units: list[str]) -> str:
    """Return the option that gives the channels' units: one for all where they are the same."""
    return f"--units {shlex.join(units if len({*units}) > 1 else units[:1])}"
