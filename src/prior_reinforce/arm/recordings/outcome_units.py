"""Units of outcomes: as the table states them, else as its numbers look."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from prior_reinforce.arm.recordings.outcomes import SD, Outcomes
from prior_reinforce.arm.recordings.units import (
    Ambiguity,
    conversion,
    is_possible,
    judge_unit,
    known_unit,
)
from prior_reinforce.errors import ConfigurationError, InvalidDemonstrationsError
from prior_reinforce.units import base_of, factor, kind_of, looks_like, units_of
from prior_reinforce.wording import listed

_FAR, _FEW = 10.0, 3
"""Times as far as all others that an outcome is in another unit, and outcomes that tell. Ours."""
_AMONG = 1.25
"""Times farther or nearer than all others that one is still among them. Ours."""
_INCHES = " (or inches: --outcome-unit in)"
_NEAR_THE_BASE = 0.05
"""So near the base along a component, in [m], hardly any table of outcomes stays. Ours."""


def in_units(
    outcomes: Outcomes, wanted: Sequence[str] | None, given: str | None
) -> tuple[Outcomes, tuple[Ambiguity, ...]]:
    """Convert outcomes to the wanted units, or to metres; also return units that are only guessed.

    `given` is the user's unit of components without one, or confirms an ambiguous one.
    ConfigurationError if a unit cannot be converted, `given` has no use, or one `sd` is for several
    units; InvalidDemonstrationsError if a stated unit is impossible.
    """
    said, where, given = outcomes.units, outcomes.where, given and (known_unit(given) or given)
    wanted = wanted and [known_unit(unit) or unit for unit in wanted]
    if wanted is None:
        wanted = [base_of(unit or given or "m")[0] for unit in said]
    if len(wanted) != len(said):
        return outcomes, ()  # refused when they are joined with the demonstrations
    if given is not None and None not in said and given not in said:
        raise ConfigurationError(
            f"--outcome-unit {given} has no use, since {where} says its units; drop it"
        )
    if outcomes.sd.any() and len(set(wanted)) > 1:
        raise ConfigurationError(
            f"{SD} in {where} is one number for components in {', '.join(wanted)}; leave that "
            "column out"
        )
    outcomes, shared = _shared_unit(outcomes, wanted) if given is None else (outcomes, ())
    said = outcomes.units
    _refuse_odd_row(outcomes, wanted, given)
    reach = np.abs(outcomes.values).max(axis=0, initial=0.0, where=~np.isnan(outcomes.values))
    unsaid = {
        j: unit
        for j, (own, unit) in enumerate(zip(said, wanted, strict=True))
        if own is None and given is None and kind_of(unit) == "length"
    }
    together = max((reach[j] for j in unsaid), default=0.0)  # lengths of one table have one unit
    scale, unclear = [], dict[str, list[str]]()
    for j, (name, own, unit) in enumerate(zip(outcomes.names, said, wanted, strict=True)):
        largest = reach[j]
        judged = together if len({*unsaid.values()}) == 1 and j in unsaid else largest
        recorded = own or given or judge_unit(unit, judged) or unit
        if base_of(recorded)[0] != base_of(unit)[0]:
            raise ConfigurationError(
                f"{name} in {where} is in {recorded}, but its unit is to be {unit}; correct "
                "either (a workspace has it in workspace.toml, [outcome]; in the head, brackets "
                "hold a unit alone, and what counts to the right is called right)"
            )
        scale.append(conversion(recorded, unit, f"{name} in {where}"))
        most = largest * scale[-1]
        looks = judge_unit(unit, most)
        rename = f"if that is in {looks}, call its column {name} [{looks}]"
        if not is_possible(unit, most):
            raise InvalidDemonstrationsError(
                f"in {where}, {name} is said to be in {recorded} and would reach {most:.4g} "
                f"{unit}, too far for an arm; {rename}"
            )
        if own is None and given is None and recorded != unit:
            unclear.setdefault(recorded, []).append(f"{name} reaches {largest:.4g}")
        elif own is not None and given != unit and looks != unit:
            unclear.setdefault(unit, []).append(f"{name} reaches {most:.4g} {unit} ({rename})")
    _refuse_one_unit(outcomes, wanted, [*unclear])
    ambiguities = tuple(
        Ambiguity(
            f"in {where}, {' and '.join(reached)}, too far for an arm"
            + (f": it looks like {unit}{_INCHES * (unit == 'cm')}" if unit not in said else ""),
            f"--outcome-unit {unit}",
        )
        for unit, reached in unclear.items()
    )
    first = wanted[0] if wanted else ""
    sd_scale = conversion(outcomes.sd_unit, first, SD) if outcomes.sd_unit else [*scale, 1.0][0]
    values, sd = outcomes.values * np.array(scale), outcomes.sd * sd_scale
    if given is not None and None in said:
        where += f", in {given} as --outcome-unit says{_INCHES * (given == 'cm')}"
    units = tuple(wanted)
    converted = replace(outcomes, where=where, values=values, sd=sd, units=units, sd_unit=first)
    converted = replace(converted, remarks=(*converted.remarks, *_unmeasured(converted)))
    apart = float(np.nanmax(np.ptp(values, axis=0), initial=0.0)) if len(values) else 0.0
    most, as_wide = float(sd.max(initial=0.0)), ""
    if len(values) > _FEW and 0 < apart <= most:
        as_wide = f", and all outcomes are within {apart:.4g} {first} of each other"
    looks = looks_like(first, most, error=True) or (as_wide and "cm")
    if outcomes.sd_unit is None and looks:
        raise InvalidDemonstrationsError(
            f"{SD} in {where} is up to {most:.4g} {first}{as_wide}; say its unit in its head: "
            f"{SD} [{looks}], or {SD} [{first}] if that is right"
        )
    return converted, (*shared, *ambiguities)


def _unmeasured(outcomes: Outcomes) -> Iterator[str]:
    """Say which rows are 0 in every component, where others lie to one side of that."""
    zero = ~np.any(outcomes.values, axis=1)
    around = np.all(np.any(outcomes.values < 0, axis=0) & np.any(outcomes.values > 0, axis=0))
    if outcomes.values.shape[1] > 1 and 0 < zero.sum() < len(zero) / 2 and not around:
        yield (
            f"{listed(np.array(outcomes.episodes)[zero].tolist())} landed at 0 in every component, "
            "where the robot's base is: if that was not measured, leave it out (--leave-out)"
        )


def _shared_unit(
    outcomes: Outcomes, wanted: Sequence[str]
) -> tuple[Outcomes, tuple[Ambiguity, ...]]:
    """Give lengths without a unit that of the others, `cm` of `x_cm, y`, and ask about it."""
    scale, k = np.array(outcomes.scale), range(len(wanted))
    lengths = [j for j in k if kind_of(wanted[j]) == "length"]
    unsaid = [j for j in lengths if outcomes.units[j] is None]
    sizes, said = units_of("length"), [j for j in lengths if outcomes.units[j] == "m"]
    units = {unit for unit, size in sizes.items() if size in scale[said]}
    far = float(np.nanmax(np.abs(outcomes.values[:, unsaid]), initial=0.0))
    if not far or len(units) != 1 or units == {wanted[unsaid[0]]}:
        return outcomes, ()
    (unit,), plain = units, wanted[unsaid[0]]
    own, other = (" and ".join(outcomes.names[j] for j in each) for each in (unsaid, said))
    asked = Ambiguity(
        f"in {outcomes.where}, {own} (up to {far:.4g}) has no unit beside {other} in {unit}: it "
        f"may be {unit} as well (if it is in {plain}: --outcome-unit {plain})",
        f"--outcome-unit {unit}",
        guessed=judge_unit(plain, far) != plain,
    )
    factors = np.array([sizes[unit] if j in unsaid else 1.0 for j in k])
    filled = tuple("m" if j in unsaid else outcomes.units[j] for j in k)
    values, sd = outcomes.values * factors, outcomes.sd
    sd = sd if outcomes.sd_unit else sd * factors[0]
    scales = tuple((scale * factors).tolist())
    return replace(outcomes, values=values, sd=sd, units=filled, scale=scales), (asked,)


def _refuse_one_unit(outcomes: Outcomes, wanted: Sequence[str], unclear: Sequence[str]) -> None:
    """Refuse components that look like several units, of which no option gives each its own."""
    far = np.nanmax(np.abs(outcomes.values), axis=0, initial=0.0)
    looks = [judge_unit(unit, most) or unit for unit, most in zip(wanted, far, strict=True)]
    unsaid = [j for j, unit in enumerate(outcomes.units) if unit is None]
    several = len({kind_of(unit) for unit in unclear}) > 1
    for unit in unclear:
        alike = [j for j in unsaid if kind_of(wanted[j]) == kind_of(unit) == "length"]
        near = [far[j] * (factor(unit, "m") or 1.0) for j in alike if looks[j] == wanted[j]]
        several |= any(0 < most < _NEAR_THE_BASE for most in near)
    if several:
        names = [outcomes.names[j] for j in unsaid]
        each = ", ".join(f"{outcomes.names[j]} {far[j]:.4g}" for j in unsaid)
        heads = [f"{name} [{looks[j]}]" for name, j in zip(names, unsaid, strict=True)]
        one = ""
        if len(unclear) == 1 and {kind_of(wanted[j]) for j in unsaid} == {"length"}:
            one = f"--outcome-unit {unclear[0]} (or {wanted[unsaid[0]]}) if all are in that, else "
        raise InvalidDemonstrationsError(
            f"in {outcomes.where}, the largest numbers are {each}, which look like several units: "
            f"say {one}each one's in the head (if they are these: {', '.join(heads)})"
        )


def _refuse_odd_row(outcomes: Outcomes, units: Sequence[str], given: str | None) -> None:
    """Refuse a few rows in another unit than the others: 95 beside 0.8 and 1.05, or 0.9 beside 80.

    An arm reaches only the others, or in another unit these would lie among them.
    """
    numbers, right = np.abs(outcomes.values).T, ""
    for number, own, unit in zip(numbers, outcomes.units, units, strict=True):
        odd = np.array([judge_unit(unit, each) not in (unit, None) for each in number])
        few = 0 < odd.sum() < len(odd) / 2 and not (own and is_possible(own, max(number[odd])))
        if few and min(number[odd]) > _FAR * np.nanmax(number[~odd], initial=0.0):
            break
    else:
        stated = None not in outcomes.units
        if outcomes.sources or (given is not None and stated):
            return
        number, odd = _odd_lengths(outcomes, units, given)
        right = ", or confirm them with --outcome-unit m" * stated
    if odd.any():
        episodes = listed(np.array(outcomes.episodes)[odd].tolist())
        least, most = np.nanmin(number[~odd]), np.nanmax(number[~odd])
        raise InvalidDemonstrationsError(
            f"in {outcomes.where}, {episodes} is in another unit than the others, or was not "
            f"measured: {min(number[odd]):.4g} beside {least:.4g} to {most:.4g}; write all in one, "
            f"and name it in the head{right}, or leave out what was not measured (--leave-out)"
        )


def _odd_lengths(
    outcomes: Outcomes, units: Sequence[str], given: str | None
) -> tuple[Float[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Size of each row's lengths together, as written; and the few far from all others by units."""
    lengths = [j for j, unit in enumerate(units) if kind_of(unit) == "length"]
    values = np.nan_to_num(outcomes.values[:, lengths])
    number = np.linalg.norm(values / np.array(outcomes.scale)[lengths], axis=1)
    around = len(values) > 0 and np.all((values.min(axis=0) < 0) & (values.max(axis=0) > 0))
    if not number.any() or (around and len(lengths) == 1):  # near zero is among the others
        return number, number < 0
    usual = float(np.median(number[number > 0]))
    unsaid = [units[j] for j in lengths if outcomes.units[j] is None]
    own = base_of(given or judge_unit(unsaid[0], usual) or unsaid[0])[1] if unsaid else 1.0
    size = np.linalg.norm(values, axis=1) * own
    ranked = np.sort(size[size > 0])
    apart = _FAR if around else _FAR / _AMONG
    others = max(np.split(ranked, np.flatnonzero(ranked[1:] > apart * ranked[:-1]) + 1), key=len)
    far = (size > 0) & ((size < others[0]) | (size > others[-1]))
    if len(others) < max(_FEW, far.sum() + 1):
        return number, number < 0
    by_unit = np.outer(list(units_of("length").values()), number)
    among = (by_unit > others[0] / _AMONG) & (by_unit < others[-1] * _AMONG)
    return number, far & among.any(axis=0)
