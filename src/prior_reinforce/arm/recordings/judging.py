"""Units of the selected channels: each take's as it states them, else as its numbers look.

Takes are judged each on its own, and channels by their names and numbers: nothing is converted by
what another take states, or another channel looks like.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from prior_reinforce.arm.recordings.naming import vectors
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.units import (
    Ambiguity,
    is_no_angle,
    is_possible,
    judge_unit,
    may_be_length,
    odd_takes,
    place_names,
    say_names,
    says_angle,
)
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from prior_reinforce.plans.whole_turns import TURN
from prior_reinforce.units import base_of, factor

UNIT = "UNIT"
"""What stands for a unit that only the user knows, in an option to complete."""
_MOST_PERCENT = 110.0
"""Percent of a range; ours: calibrations overshoot by a few."""
_NORMALISED = (
    ", unless LeRobot recorded shares of each joint's range (-100 to 100, where use_degrees is "
    "unset): those are no angles; record with use_degrees, or import them as percent into a "
    "workspace of --robot none"
)


def in_one_unit(
    recordings: Sequence[Recording],
    names: Sequence[str],
    by_file: Sequence[Sequence[str | None]],
    said: Sequence[str | None],
    given: bool,
) -> tuple[list[Recording], list[str], list[Ambiguity]]:
    """Recordings in the unit `said`, each converted by what its own file states.

    With a remark on what was in several units, and a doubt on each channel whose unit some files
    state and others do not, unless it is `given`.
    """
    scale = np.ones((len(recordings), len(names)))
    remarks, doubts = [], []
    for i, name in enumerate(names):
        of_unit: dict[str | None, list[int]] = {}
        for k, units in enumerate(by_file):
            of_unit.setdefault(units[i], []).append(k)
        called = {u: _episodes(recordings, own) for u, own in of_unit.items()}
        stating = [unit for unit in of_unit if unit is not None]
        for unit in stating:
            there = factor(unit, said[i] or unit)
            if there is None:
                raise InvalidDemonstrationsError(
                    f"{name} is in {stating[0]} in {called[stating[0]]}, but in {unit} in "
                    f"{called[unit]}; correct what is wrong, or leave it out (--leave-out)"
                )
            scale[of_unit[unit], i] = there
        each = ", ".join(f"in {unit} in {called[unit]}" for unit in stating)
        if len(stating) > 1:
            remarks.append(f"{name} is {each}, as they state: each is converted")
        if stating and None in of_unit and not given:
            silent, others = of_unit[None], [k for unit in stating for k in of_unit[unit]]
            here, there = (
                max(float(np.abs(recordings[k].positions[:, i]).max()) for k in group)
                for group in (silent, others)
            )
            what = (
                f"{name} is {each} (up to {there:.4g}), and {called[None]} states no unit (up to "
                f"{here:.4g}): state it there, or leave out"
            )
            fewer = silent if len(silent) <= len(others) else others
            doubts.append(_without_takes(what, [recordings[k].episode for k in fewer]))
    scaled = [
        replace(r, positions=r.positions * by) if np.any(by != 1) else r
        for r, by in zip(recordings, scale, strict=True)
    ]
    return scaled, remarks, doubts


def _episodes(recordings: Sequence[Recording], chosen: Sequence[int]) -> str:
    return say_names([recordings[k].episode for k in chosen])


def _without_takes(what: str, episodes: Sequence[str]) -> Ambiguity:
    """A doubt that leaving some takes out settles."""
    return Ambiguity(what, f"--leave-out {shlex.join(episodes)}", guessed=False)


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
        fewer = asked if len(asked) <= len(others) else others
        if fewer is asked:
            del found[option]
        alone = _without_takes(what, fewer)
        found[alone.option] = alone
    return list(found.values())


def odd_episodes(
    recordings: Sequence[Recording],
    names: Sequence[str],
    by_file: Sequence[Sequence[str | None]],
    said: Sequence[str | None],
    given: bool,
) -> tuple[set[str], list[Ambiguity]]:
    """Takes that are in another unit than the others by their numbers, and doubts that name them.

    Angles are judged together and lengths together, a gripper by itself.
    """
    places = place_names(names)
    units = [unit or ("m" if n in places else "rad") for n, unit in zip(names, said, strict=True)]
    silent = any if given else all  # else what only some state is asked about anyway
    open_ = [i for i in range(len(names)) if silent(own[i] is None for own in by_file)]
    tools = [i for i in open_ if is_no_angle(names[i])]
    arms = [i for i in open_ if i not in tools]
    groups = [("rad", [i for i in arms if units[i] in TURN])]
    groups += [("m", [i for i in arms if base_of(units[i])[0] == "m"])]
    groups += [("", [i]) for i in tools]
    reach = np.array([np.abs(r.positions).max(axis=0) for r in recordings])
    odd: dict[tuple[str, ...], list[str]] = {}
    for kind, among in groups:
        if not among:
            continue
        most = reach[:, among].max(axis=1)
        found = odd_takes(most.tolist(), kind)
        if not found:
            continue
        usual = [k for k in range(len(recordings)) if k not in found]
        worst = found[int(np.argmax(most[found]))]
        where = names[among[int(np.argmax(reach[worst, among]))]]
        apart = max(most[worst] / most[usual].max(), most[usual].max() / most[worst])
        what = (
            f"{where} of {recordings[worst].episode} reaches {most[worst]:.4g}, and of the others "
            f"{most[usual].max():.4g} at most, {apart:.3g} times apart"
        )
        episodes = tuple(recordings[k].episode for k in found)
        odd.setdefault(episodes, []).append(what)
    doubts = [
        _without_takes(
            f"{'; '.join(whats)}: {say_names(episodes)} may be in another unit; convert what is, "
            "or leave it out",
            episodes,
        )
        for episodes, whats in odd.items()
    ]
    return {name for episodes in odd for name in episodes}, doubts


def _of_one_unit(
    names: Sequence[str],
    units: Sequence[str],
    most: np.ndarray,
    angles: list[int],
    *,
    together: bool,
) -> list[int]:
    """Angles that are in another unit than they are said to be, with those that share their unit.

    Joints of one recorder have one unit (`together`), unless few of them only are out of range:
    then those that are numbered like these.
    """
    far = [i for i in angles if judge_unit(units[i], most[i]) not in (units[i], None)]
    near = max((most[i] for i in angles if i not in far), default=math.inf)
    if far and (together or 2 * len(far) > len(angles) or near > TURN["rad"]):
        return angles
    alike = [{i, *g} for i in far for g in vectors(names).values() if i in g]
    return [i for i in angles if i in far or any(i in group for group in alike)]


def judge_units(
    recordings: Sequence[Recording],
    names: Sequence[str],
    said: Sequence[str | None],
    wanted: Sequence[str],
    *,
    given: Literal["no", "one for all", "each"],
    open_: bool,
    normalised: bool,
    fixed: bool,
) -> tuple[list[str], list[Ambiguity], list[str], str]:
    """Infer the unit of each channel: as stated if possible, else as wanted, else as it looks.

    `said` are units given or from the file, and `given` how they were given: believed where they
    are possible. `open_`: the files state none. `fixed`: the plan says its units.

    Returns units, what is ambiguous of them, remarks, and `Selection.other_unit`.
    """
    reach = np.array([np.abs(r.positions).max(axis=0) for r in recordings])
    most = reach.max(axis=0)
    recorded = [unit or w for unit, w in zip(said, wanted, strict=True)]
    for i, unit in enumerate(recorded):
        if unit == "percent" and said[i] and given != "no" and open_ and most[i] > _MOST_PERCENT:
            where = recordings[int(np.argmax(reach[:, i]))].episode
            raise ConfigurationError(
                f"{names[i]} reaches {most[i]:.4g} in {where}, and --units says percent, of which "
                "a range has 100: say its own unit, or counts for a number without a unit"
            )
    angles = [i for i, unit in enumerate(recorded) if unit in TURN and not is_no_angle(names[i])]
    small = given == "one for all" and open_ and {recorded[i] for i in angles} == {"deg"}
    small = small and most[angles].max() < TURN["rad"]
    far = _of_one_unit(names, recorded, most, angles, together=fixed or given != "no")
    lengths = place_names(names)  # of one recorder, in one unit
    places = [i for i, unit in enumerate(recorded) if unit == "m" and names[i] in lengths]
    groups: dict[tuple[str, str | None, str], list[int]] = {}
    doubtful, other = dict[tuple[str, str], int](), ""
    single = len(set(recorded)) == 1
    for i, unit in enumerate(recorded):
        number = max(most[j] for j in places) if i in places else most[i]
        looks, why = judge_unit(unit, number, opening=is_no_angle(names[i])), "which no arm does"
        if unit == "percent":
            why = "which is hardly a motion" if looks else "which no share of a range does"
        alone = i in far and len(far) < len(angles) and not fixed
        tool = is_no_angle(names[i])
        slides = may_be_length(names[i]) and unit in TURN and not fixed and most[i] > 0
        slides = slides and (given == "one for all" and open_ if given != "no" else i in far)
        if slides:
            looks, why = None, "and its name leaves open if it turns or slides"
        elif unit in TURN and looks != unit and said[i] is None and (tool or alone):
            why = f"beside joints in {unit}" if alone else "by its name"
            if alone and says_angle(names[i]):
                looks, why = "deg", "which no arm does"
            else:
                looks, why = "percent" if most[i] <= 100 else None, f"and {why} it is no angle"
        elif small and i in angles:
            looks, why = "rad", "which is hardly a motion"
        elif looks == unit and i in far:
            looks = "deg"
        elif looks == unit:
            continue
        alike = far if i in far else [i]
        impossible = open_ and single and not all(is_possible(unit, most[j]) for j in alike)
        if (
            said[i] is None
            or slides
            or (small and i in angles)
            or (given != "no" and impossible and looks)
        ):
            groups.setdefault((unit, looks, why), []).append(i)
        elif looks is not None:
            worst = doubtful.setdefault((unit, looks), i)
            doubtful[unit, looks] = i if most[i] > most[worst] else worst
    remarks = []
    for (unit, looks), i in doubtful.items():
        where = f"{names[i]} of {recordings[int(np.argmax(reach[:, i]))].episode}"
        other = f"--units {looks}" if open_ and single else other
        advice = f"if it was recorded in {looks}, say {other}" if other else "check its unit"
        remarks.append(f"{where} reaches {most[i]:.4g} {unit}, and arms do not: {advice}")
    unclear = []
    for (unit, looks, why), among in groups.items():
        worst = among[int(np.argmax(most[among]))]
        episode = recordings[int(np.argmax(reach[:, worst]))].episode
        by = ", as --units says," if given != "no" else ""
        seen = f"it looks like {looks}" if looks else f"put its unit in the place of {UNIT}"
        if looks == "deg" and normalised and most[among].max() <= 100:
            seen += _NORMALISED
        called = say_names([names[i] for i in among])
        reaches = f"would reach {most[worst]:.4g} ({names[worst]} of {episode})"
        unclear.append(f"{called} in {unit}{by} {reaches}, {why}: {seen}")
        for i in among:
            recorded[i] = looks or UNIT
    in_degrees = bool(angles) and {recorded[i] for i in angles} == {"deg"}
    if given != "no" and normalised and in_degrees and not unclear and most[angles].max() <= 100:
        remarks.append(f"degrees, as --units says{_NORMALISED}")
    single = len(set(recorded)) == 1
    option = f"--units {recorded[0] if single else ' '.join(recorded)}"
    for i, unit in enumerate(wanted):
        unlike = base_of(recorded[i])[0] != base_of(unit)[0] and said[i] is None
        if recorded[i] == UNIT or unlike:
            recorded[i] = unit  # asked about, and not converted
    return (
        recorded,
        [Ambiguity(what, option, UNIT not in option) for what in unclear],
        remarks,
        other,
    )
