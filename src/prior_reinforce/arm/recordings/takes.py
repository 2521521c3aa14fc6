"""Takes that are not as the others: in the units that they state, in their numbers, in their times.

Nothing is converted by what another take states. A take that may be in another unit is named, and
can be left out.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from prior_reinforce.arm.recordings.channels import Kind
from prior_reinforce.arm.recordings.judging import Belief
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.units import Ambiguity, judge_unit, known_unit, say_names
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from prior_reinforce.plans.whole_turns import TURN
from prior_reinforce.units import base_of, factor, spelt, without_number

_APART: Mapping[str, Sequence[float]] = {"rad": (TURN["deg"] / TURN["rad"],), "m": (100.0, 1000.0)}
"""How many times larger numbers get by the next unit: rad to deg, m to cm and mm."""
_ALIKE = 1.5
"""How many times takes of one task may differ. Ours."""
_FAR_APART = 20.0
"""Times apart from which two plausible units are two. Ours."""


def in_one_unit(
    recordings: Sequence[Recording], names: Sequence[str], given: Sequence[str | None]
) -> tuple[list[Recording], list[str | None], list[str], list[Ambiguity]]:
    """Bring each channel into the unit that is given, else into that of the first file stating one.

    Returns the takes, each converted by what its own file states; the channels' units; a remark on
    each channel that was in several; a doubt on each whose unit some files state and others do not.

    Raises:
        ConfigurationError: A file states another unit than the one that is given.
        InvalidDemonstrationsError: Two files state units of which one cannot be converted.
    """
    scale, stated = np.ones((len(recordings), len(names))), list[str | None]()
    remarks, doubts = [], []
    for i, (name, unit) in enumerate(zip(names, given, strict=True)):
        takes: dict[str, list[Recording]] = {}
        for recording in recordings:
            takes.setdefault(recording.units[i] or "", []).append(recording)
        silent = takes.pop("", [])
        called = {own: _called(of_unit) for own, of_unit in takes.items()}
        first = next(iter(takes), None)
        said = unit and (known_unit(unit) or unit)
        stated.append(said or first)
        for own, of_unit in takes.items():
            by = factor(own, said or str(first))
            is_word = by is None and not spelt(without_number(own)[0])
            if is_word and said is not None and spelt(said):
                by = 1.0  # `Grad`, which is no listed unit
                remarks.append(f"{name} is in {own} in {called[own]}, taken for {said}, as said")
            elif said not in (None, own):
                raise ConfigurationError(
                    f"{of_unit[0].columns[i]} of episode {of_unit[0].episode} is in {own}, but "
                    f"--units says {said}; correct or drop it"
                )
            if by is None:
                raise InvalidDemonstrationsError(
                    f"{name} is in {first} in {called[str(first)]}, but in {own} in {called[own]}; "
                    "correct what is wrong, or leave it out (--leave-out)"
                )
            scale[[r.units[i] == own for r in recordings], i] = by
        each = ", ".join(f"in {own} in {where}" for own, where in called.items())
        if len(takes) > 1:
            remarks.append(f"{name} is {each}, as they state: each is converted")
        if takes and silent:
            stating = [*chain(*takes.values())]
            here, there = (
                max(np.abs(r.positions[:, i]).max() for r in of) for of in (silent, stating)
            )
            what = (
                f"{name} is {each} (up to {there:.4g}), and {_called(silent)} states no unit (up "
                f"to {here:.4g}): state it there, or leave out"
            )
            doubts.append(_without(what, [r.episode for r in min(silent, stating, key=len)]))
    scaled = [
        replace(r, positions=r.positions * by) if np.any(by != 1) else r
        for r, by in zip(recordings, scale, strict=True)
    ]
    return scaled, stated, remarks, doubts


def _called(recordings: Sequence[Recording]) -> str:
    return say_names([recording.episode for recording in recordings])


def odd_takes(beliefs: Sequence[Belief]) -> tuple[set[str], list[Ambiguity]]:
    """Return takes that are in another unit than the others by their numbers, and why.

    Angles are held together and lengths together, a gripper by itself.
    """
    groups: list[tuple[str, list[Belief]]] = [
        (unit, [b for b in beliefs if b.kind is not Kind.TOOL and base_of(b.unit)[0] == unit])
        for unit in _APART
    ]
    groups += [("", [one]) for one in beliefs if one.kind is Kind.TOOL]
    found: dict[tuple[str, ...], list[str]] = {}
    for unit, group in groups:
        if not group:
            continue
        most = {take: max(one.reach[take] for one in group) for take in group[0].reach}
        odd = apart_from_most(most, unit)
        if odd:
            usual = max(number for take, number in most.items() if take not in odd)
            worst = max(odd, key=lambda take: most[take])
            name = next(one.name for one in group if one.reach[worst] == most[worst])
            apart = max(most[worst] / usual, usual / most[worst])
            found.setdefault(odd, []).append(
                f"{name} of {worst} reaches {most[worst]:.4g}, and of the others {usual:.4g} at "
                f"most, {apart:.3g} times apart"
            )
    doubts = [
        _without(
            f"{'; '.join(whats)}: {say_names(episodes)} may be in another unit; convert what is, "
            "or leave it out",
            episodes,
        )
        for episodes, whats in found.items()
    ]
    return {name for episodes in found for name in episodes}, doubts


def apart_from_most(reach: Mapping[str, float], unit: str) -> tuple[str, ...]:
    """Return the takes whose numbers are apart from most others' by as much as two units are.

    `reach` is the largest number of each take: of angles in `rad`, of lengths in `m`, else of what
    is a share where it is at most 1.
    """
    middle = sorted(reach.values())[(len(reach) - 1) // 2]
    odd = []
    for take, number in reach.items():
        if min(number, middle) <= 0:
            continue
        apart = max(number / middle, middle / number)
        looks, usual = (judge_unit(unit, n) if unit else str(n <= 1) for n in (number, middle))
        between = any(f / _ALIKE <= apart <= f * _ALIKE for f in _APART.get(unit, ()))
        if between or (looks != usual and apart >= _FAR_APART):
            odd.append(take)
    return tuple(odd)


def doubts_of_times(recordings: Sequence[Recording]) -> list[Ambiguity]:
    """What is only guessed of the times, one doubt for each option.

    Where some takes only are in another unit, the fewer are to be left out: no option holds for
    all.
    """
    found = {one.option: one for r in reversed(recordings) for one in r.ambiguities}
    for option, doubt in list(found.items()):
        asked = [r.episode for r in recordings if option in [one.option for one in r.ambiguities]]
        others = [r.episode for r in recordings if r.episode not in asked]
        if not option.startswith("--time-unit") or not others:
            continue
        what = (
            f"{say_names(asked)}: {doubt.what}, but {say_names(others)} would not be in that "
            "unit: convert what is in another one than the rest, or leave it out"
        )
        fewer = min(asked, others, key=len)
        if fewer is asked:
            del found[option]
        alone = _without(what, fewer)
        found[alone.option] = alone
    return list(found.values())


def _without(what: str, episodes: Sequence[str]) -> Ambiguity:
    """A doubt that leaving some takes out settles."""
    return Ambiguity(what, f"--leave-out {shlex.join(episodes)}", guessed=False)
