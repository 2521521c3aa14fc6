"""Units of the selected channels: what is believed of each, what makes it doubtful, what is asked.

A channel is in the unit that is stated for it; else in the plan's. Rules doubt that by the
channel's name and its largest number, the first that applies: each is a method of `_Judge` and says
what the numbers look like, and why. What nobody stated is asked about; what somebody stated is
believed where it is possible, and remarked on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from prior_reinforce.arm.recordings.channels import Kind, kinds
from prior_reinforce.arm.recordings.naming import vectors
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.takes import in_one_unit, odd_takes
from prior_reinforce.arm.recordings.units import (
    Ambiguity,
    is_possible,
    judge_unit,
    known_unit,
    say_names,
)
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.whole_turns import TURN
from prior_reinforce.units import base_of

UNIT = "UNIT"
"""What stands for a unit that only the user knows, in an option to complete."""
Given = Literal["", "one for all", "each"]
"""How --units gives the recorded units; empty where it does not."""
_MOST_PERCENT = 110.0
"""Percent of a range; ours: calibrations overshoot by a few."""
_NOT_DONE, _HARDLY = "which no arm does", "which is hardly a motion"
_NORMALISED = (
    ", unless LeRobot recorded shares of each joint's range (-100 to 100, where use_degrees is "
    "unset): those are no angles; record with use_degrees, or import them as percent into a "
    "workspace of --robot none"
)


@dataclass(frozen=True)
class Judged:
    """Recordings with the units of their channels, and what is doubted of these."""

    recordings: list[Recording]
    """Each take in the unit `recorded`."""
    recorded: list[str]
    """Unit in which each channel was recorded."""
    wanted: list[str]
    """Unit of each channel of the plan."""
    questions: list[Ambiguity]
    remarks: list[str]
    other_unit: str
    """As `Selection.other_unit`."""


@dataclass(frozen=True, eq=False)
class Belief:
    """What is believed of the unit of one channel."""

    name: str
    kind: Kind
    stated: str | None
    """Unit that --units gives, or a file states; None where nobody does."""
    unit: str
    """Unit that it is taken to be in: as stated, else the plan's."""
    largest: float
    """Largest number that it reaches."""
    episode: str
    """The take in which it does."""


class Doubt(NamedTuple):
    """What makes a unit doubtful."""

    looks: str
    """Unit that the numbers look like; `UNIT` where they look like none."""
    why: str
    """What is wrong with the unit as it is believed: a clause."""
    asked: bool = False
    """Whether it is asked about even where somebody stated the unit."""


def judge(
    recordings: Sequence[Recording],
    names: Sequence[str],
    units: Sequence[str | None],
    plan_units: Sequence[str] | None,
    *,
    given: Given,
    normalised: bool,
) -> Judged:
    """Infer the unit of each channel: as stated if possible, else the plan's, else as it looks.

    Args:
        recordings: With the channels of the plan.
        names: Of these channels in the plan.
        units: Recorded units that are given.
        plan_units: Units of the plan; None takes base units.
        given: How `units` are given.
        normalised: Whether the recorder also writes shares of each joint's range, -100 to 100.

    Raises:
        ConfigurationError: Units that contradict a file, or each other.
        InvalidDemonstrationsError: Files that contradict each other.
    """
    told = [[r.units[i] is not None for r in recordings] for i in range(len(names))]
    stated = [_stated(recordings, i, unit) for i, unit in enumerate(units)]
    takes, mixed, unsaid = in_one_unit(recordings, names, stated)
    of_kind, most = kinds(names), _reach(takes).max(axis=0)
    usual = [kind.usual_unit(largest) for kind, largest in zip(of_kind, most, strict=True)]
    wanted = plan_units or [base_of(s or u)[0] for s, u in zip(stated, usual, strict=True)]
    believed = [s or w for s, w in zip(stated, wanted, strict=True)]
    # Of what some files state and others do not, the silent ones are asked about anyway.
    open_ = [i for i, own in enumerate(told) if not (all(own) if given else any(own))]
    odd, differ = odd_takes(takes, names, of_kind, believed, open_)
    kept = [r for r in takes if r.episode not in odd] or takes
    reach = _reach(kept)
    beliefs = []
    for i, name in enumerate(names):
        largest, episode = float(reach[:, i].max()), kept[int(np.argmax(reach[:, i]))].episode
        beliefs.append(Belief(name, of_kind[i], stated[i], believed[i], largest, episode))
    rules = _Judge(beliefs, given, not any(map(any, told)), plan_units is not None, normalised)
    rules.refuse_percent()
    remarks, other = rules.remarks()
    return Judged(
        takes,
        rules.recorded(wanted),
        list(wanted),
        [*(() if given else (*unsaid, *differ)), *rules.questions()],
        [*mixed, *(doubt.what for doubt in differ if given), *remarks],
        other,
    )


def _reach(recordings: Sequence[Recording]) -> np.ndarray:
    """Largest number of each channel in each recording."""
    return np.array([np.abs(r.positions).max(axis=0) for r in recordings])


def _stated(recordings: Sequence[Recording], channel: int, given: str | None) -> str | None:
    """Unit of a channel as given, else as the first file that states one does; None if none does.

    ConfigurationError if a file states another than the one that is given.
    """
    given = given if given is None else known_unit(given) or given
    for recording in recordings:
        own = recording.units[channel]
        if own is not None and given not in (None, own):
            raise ConfigurationError(
                f"{recording.columns[channel]} of episode {recording.episode} is in {own}, but "
                f"--units says {given}; correct or drop it"
            )
    return given or next((r.units[channel] for r in recordings if r.units[channel]), None)


@dataclass(frozen=True, eq=False)
class _Judge:
    """The rules by which the units of a recording's channels are doubted."""

    beliefs: Sequence[Belief]
    given: Given
    silent: bool
    """Whether no file states a unit."""
    fixed: bool
    """Whether the plan says its units."""
    normalised: bool

    def refuse_percent(self) -> None:
        """ConfigurationError where --units says percent of numbers that are none."""
        for one in self.beliefs:
            percent = self.given and self.silent and one.stated == one.unit == "percent"
            if percent and one.largest > _MOST_PERCENT:
                raise ConfigurationError(
                    f"{one.name} reaches {one.largest:.4g} in {one.episode}, and --units says "
                    "percent, of which a range has 100: say its own unit, or counts for a number "
                    "without a unit"
                )

    @cached_property
    def angles(self) -> list[Belief]:
        """Channels that are believed to be angles."""
        return [b for b in self.beliefs if b.unit in TURN and b.kind is not Kind.TOOL]

    @cached_property
    def far(self) -> list[Belief]:
        """Angles that are in degrees, not in radians as believed, and those that share their unit.

        Joints of one recorder have one unit, unless few of them only are out of range: then those
        that are numbered like these.
        """
        far = [one for one in self.angles if self._looks(one) not in (one.unit, None)]
        near = max((one.largest for one in self.angles if one not in far), default=0.0)
        together = self.fixed or self.given or 2 * len(far) > len(self.angles)
        if far and (together or near > TURN["rad"]):
            return self.angles
        groups = vectors([one.name for one in self.beliefs]).values()
        numbered = [{self.beliefs[i] for i in group} for group in groups]
        alike = {one for group in numbered if not group.isdisjoint(far) for one in group}
        return [one for one in self.angles if one in far or one in alike]

    @cached_property
    def places(self) -> list[Belief]:
        """Coordinates, which are all in one unit."""
        return [b for b in self.beliefs if b.unit == "m" and b.kind is Kind.PLACE]

    def _looks(self, one: Belief) -> str | None:
        """The unit that a channel's numbers look like."""
        most = max(each.largest for each in (self.places if one in self.places else [one]))
        return judge_unit(one.unit, most, opening=one.kind is Kind.TOOL)

    def _doubt(self, one: Belief) -> Doubt | None:
        """What makes a unit doubtful, by the first rule that applies; None if none does."""
        rules = (
            self._may_slide,
            self._is_no_angle,
            self._hardly_moves,
            self._is_with_others,
            self._is_beyond,
        )
        return next(filter(None, (rule(one) for rule in rules)), None)

    def _may_slide(self, one: Belief) -> Doubt | None:
        """A rail or an external axis is not in degrees only for being among angles that are."""
        among = one in self.far
        if self.given:
            among = self.given == "one for all" and self.silent
        slides = one.kind is Kind.SLIDE and one.unit in TURN and one.largest > 0
        why = "and its name leaves open if it turns or slides"
        return Doubt(UNIT, why, asked=True) if slides and among and not self.fixed else None

    def _is_no_angle(self, one: Belief) -> Doubt | None:
        """What turns too far is none: a gripper, or a name without meaning beside joints."""
        beside = one in self.far and len(self.far) < len(self.angles) and not self.fixed
        unnamed = beside and one.kind not in (Kind.ANGLE, Kind.ROTATION)
        none = one.kind is Kind.TOOL or unnamed
        if one.stated or one.unit not in TURN or not none or self._looks(one) == one.unit:
            return None
        why = f"beside joints in {one.unit}" if beside else "by its name"
        return Doubt("percent" if one.largest <= 100 else UNIT, f"and {why} it is no angle")

    def _hardly_moves(self, one: Belief) -> Doubt | None:
        """Joints that are all said to be in degrees, and stay within 6.28 of them, are not."""
        said = self.given == "one for all" and self.silent and one in self.angles
        all_in_degrees = {angle.unit for angle in self.angles} == {"deg"}
        few = max((angle.largest for angle in self.angles), default=0.0) < TURN["rad"]
        return Doubt("rad", _HARDLY, asked=True) if said and all_in_degrees and few else None

    def _is_with_others(self, one: Belief) -> Doubt | None:
        """A joint that could be in radians is in degrees with those that could not."""
        with_others = one in self.far and self._looks(one) == one.unit
        return Doubt("deg", _NOT_DONE) if with_others else None

    def _is_beyond(self, one: Belief) -> Doubt | None:
        """A number beyond what arms do is in another unit."""
        looks, why = self._looks(one), _NOT_DONE
        if one.unit == "percent":
            why = _HARDLY if looks else "which no share of a range does"
        return None if looks == one.unit else Doubt(looks or UNIT, why)

    @cached_property
    def _doubts(self) -> dict[Belief, Doubt]:
        return {one: doubt for one in self.beliefs if (doubt := self._doubt(one))}

    @cached_property
    def _one_option(self) -> bool:
        """Whether one unit for all could be given, which nothing contradicts."""
        return self.silent and len({one.unit for one in self.beliefs}) == 1

    def _is_asked(self, one: Belief) -> bool:
        """Whether a doubtful unit is asked about: nobody stated it, or it is stated wrongly."""
        doubt, alike = self._doubts[one], self.far if one in self.far else [one]
        possible = all(is_possible(one.unit, each.largest) for each in alike)
        wrong = self.given and self._one_option and not possible and doubt.looks != UNIT
        return one.stated is None or doubt.asked or bool(wrong)

    @cached_property
    def _asked(self) -> dict[Belief, Doubt]:
        return {one: doubt for one, doubt in self._doubts.items() if self._is_asked(one)}

    @cached_property
    def _answers(self) -> list[str]:
        """Unit of each channel, as it looks where that is asked about."""
        return [self._asked[one].looks if one in self._asked else one.unit for one in self.beliefs]

    def recorded(self, wanted: Sequence[str]) -> list[str]:
        """Unit of each channel; as wanted where its own cannot be told, or is of another kind."""
        return [
            unit if unit != UNIT and (one.stated or base_of(unit)[0] == base_of(want)[0]) else want
            for one, unit, want in zip(self.beliefs, self._answers, wanted, strict=True)
        ]

    def questions(self) -> list[Ambiguity]:
        """Ask about the units that look like others, all with the option that settles all."""
        groups: dict[tuple[str, Doubt], list[Belief]] = {}
        for one, doubt in self._asked.items():
            groups.setdefault((one.unit, doubt), []).append(one)
        units = self._answers[:1] if len({*self._answers}) == 1 else self._answers
        option = f"--units {' '.join(units)}"
        questions = []
        for (unit, doubt), among in groups.items():
            worst = max(among, key=lambda one: one.largest)
            seen = f"it looks like {doubt.looks}"
            if doubt.looks == UNIT:
                seen = f"put its unit in the place of {UNIT}"
            elif doubt.looks == "deg" and self.normalised and worst.largest <= 100:
                seen += _NORMALISED
            by = ", as --units says," if self.given else ""
            what = (
                f"{say_names([one.name for one in among])} in {unit}{by} would reach "
                f"{worst.largest:.4g} ({worst.name} of {worst.episode}), {doubt.why}: {seen}"
            )
            questions.append(Ambiguity(what, option, UNIT not in units))
        return questions

    def remarks(self) -> tuple[list[str], str]:
        """Remark on units that are stated and doubtful; with the option that would give others."""
        worst: dict[tuple[str, str], Belief] = {}
        for one, doubt in self._doubts.items():
            if one not in self._asked and doubt.looks != UNIT:
                known = worst.setdefault((one.unit, doubt.looks), one)
                worst[one.unit, doubt.looks] = max(known, one, key=lambda one: one.largest)
        remarks, other = [], ""
        for (unit, looks), one in worst.items():
            other = f"--units {looks}" if self._one_option else ""
            advice = f"if it was recorded in {looks}, say {other}" if other else "check its unit"
            where = f"{one.name} of {one.episode}"
            remarks.append(f"{where} reaches {one.largest:.4g} {unit}, and arms do not: {advice}")
        in_degrees = {angle.unit for angle in self.angles} == {"deg"} and not self._asked
        shares = self.normalised and all(angle.largest <= 100 for angle in self.angles)
        if self.given and in_degrees and shares:
            remarks.append(f"degrees, as --units says{_NORMALISED}")
        return remarks, other
