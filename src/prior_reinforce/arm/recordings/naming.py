"""Which recorded channel is which joint: one rule for the gate, the manifest and recordings."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from prior_reinforce.arm.recordings.units import CHANNEL_UNITS, say_names, split_unit
from prior_reinforce.arm.robots.limits import is_joint
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.plans.channels import is_opening, measured_of, says_no_position

_POSITIONS = re.compile(r"(^|[^a-z])(q|j|joints?|pos|positions?|angles?)$", re.IGNORECASE)
"""Names of joint positions."""
_OF_POSITIONS = re.compile(
    r"(?<=.)([./\[]+(positions?|angle|value|q)\]?|_pos(ition)?)$", re.IGNORECASE
)
"""What follows a joint's name where tools write the messages' fields: `/elbow/position`."""
Texts = Mapping[str, tuple[str, ...]]
"""Texts of a file, by their names in it."""
OTHER_NAMES = re.compile(
    r"link|bod(y|ies)|camera|task|object|site|sensor|frame|goal|outcome|limit", re.I
)
"""Names in a file of other things than the motion."""
_DEEPEST = 12
"""Levels of dicts that are searched for names."""
_NUMBERED = re.compile(r"(?P<stem>.*?)[_.\[ ]*(?P<number>\d+)\]?")


def find_channels(wanted: Sequence[str], there: Sequence[str]) -> list[int] | None:
    """Return the channel of each wanted joint, by `robots.limits.is_joint`; None if one is missing.

    InvalidDemonstrationsError if two channels look like one joint.
    """
    found = [_find(name, there, wanted) for name in wanted]
    picked = [index for index in found if index is not None]
    return picked if len(picked) == len(wanted) else None


def missing_channels(wanted: Sequence[str], there: Sequence[str]) -> list[str]:
    """Return the wanted joints that are missing, by the rule of `find_channels`."""
    return [name for name in wanted if _find(name, there, wanted) is None]


def vectors(names: Sequence[str]) -> dict[str, list[int]]:
    """Return numbered channels by the name before the number: `{"q": [0, 1]}` of `q_0, q_1, t`."""
    groups: dict[str, list[tuple[int, int]]] = {}
    for index, name in enumerate(names):
        match = _NUMBERED.fullmatch(name.strip())
        if match is not None and match["stem"]:
            groups.setdefault(match["stem"], []).append((int(match["number"]), index))
    return {stem: [i for _, i in sorted(g)] for stem, g in groups.items() if len(g) > 1}


def joint_vectors(names: Sequence[str], count: int) -> dict[str, list[int]]:
    """Return the groups of `vectors` of this size that may be positions, by their names."""
    return {
        stem: group
        for stem, group in vectors(names).items()
        if len(group) == count and not says_no_position(stem)
    }


def numbered_like(joints: Sequence[str], there: Sequence[str]) -> tuple[str, ...] | None:
    """Return the numbered channels that may be the joints: `q`, not `dq`; None if unclear."""
    fitting = joint_vectors(there, len(joints))
    called = [stem for stem in fitting if _POSITIONS.search(stem) is not None]
    clear = list(fitting) if len(fitting) == 1 else called
    return tuple(there[i] for i in fitting[clear[0]]) if len(clear) == 1 else None


def words(values: Any) -> tuple[str, ...]:
    """Return the texts in an array, or in one text that lists several; none if it holds others."""
    items = values.ravel().tolist() if isinstance(values, np.ndarray) else values
    texts = list(items) if isinstance(items, (list, tuple)) else [items]
    texts = [t.decode(errors="replace") if isinstance(t, bytes) else t for t in texts]
    if not all(isinstance(text, str) for text in texts):
        return ()
    if len(texts) == 1:
        text = texts[0].strip().strip("[]()")
        texts = text.split(",") if "," in text else text.split()
    return tuple(str(text).strip().strip("'\"") for text in texts)


def read_metadata(
    metadata: Mapping[str, Any],
) -> tuple[dict[str, tuple[str, ...]], dict[str, float]]:
    """Return the texts and numbers in metadata of a file, by their path: `meta.fps`."""
    texts: dict[str, tuple[str, ...]] = {}
    numbers: dict[str, float] = {}
    for name, nested in metadata.items():
        for path, value in _search(name, nested):
            if isinstance(value, (int, float)):
                numbers.setdefault(path, value)
            elif found := words(value):
                texts.setdefault(path, found)
    return texts, numbers


def _search(path: str, value: Any, depth: int = _DEEPEST) -> Iterator[tuple[str, Any]]:
    """Yield every number, text and list of texts in nested metadata, with its path."""
    value = value.tolist() if isinstance(value, np.ndarray) else value
    value = value[0] if isinstance(value, list) and len(value) == 1 else value
    value = value.decode(errors="replace") if isinstance(value, bytes) else value
    if isinstance(value, str) and value.lstrip("\ufeff \r\n\t")[:1] in ("{", "["):
        with contextlib.suppress(ValueError, RecursionError):
            value = json.loads(value.lstrip("\ufeff"))
    if isinstance(value, list) and value and all(isinstance(item, Mapping) for item in value):
        keys = [key for key in value[0] if all(key in item for item in value)]
        value = {key: [item[key] for item in value] for key in keys}  # [{"name": "elbow"}, ...]
    if isinstance(value, Mapping):
        names = _numbered(value)
        if all(isinstance(item, str) for item in value.values()):
            names = names or _numbered({item: key for key, item in value.items()})
        if names:
            yield path, names
            return
        for key, item in value.items() if depth else ():
            yield from _search(f"{path}.{key}" if path else str(key), item, depth - 1)
    elif isinstance(value, str) and value.lstrip()[:1] == "{":
        return
    elif isinstance(value, (int, float, str)):
        yield path, value
    elif isinstance(value, (list, tuple)):
        groups = value and all(isinstance(item, list) for item in value)
        yield path, [*chain(*value)] if groups else [*value]


def _numbered(value: Mapping[Any, Any]) -> list[str]:
    """Return names by the numbers that they have, as `{"elbow": 0, "pan": 1}`; none of others."""
    at = {str(n): str(name) for name, n in value.items() if isinstance(n, (int, str))}
    numbers = list(map(str, range(len(value))))
    return [at[number] for number in numbers] if sorted(at) == sorted(numbers) else []


def _find(name: str, there: Sequence[str], wanted: Sequence[str]) -> int | None:
    bare = split_unit(name, CHANNEL_UNITS)[0]
    for exact in (name, bare):
        if list(there).count(exact) > 1:
            raise InvalidDemonstrationsError(f"several columns are called {exact}; rename them")
        if exact in there:
            return there.index(exact)
    names = [_OF_POSITIONS.sub("", split_unit(channel, CHANNEL_UNITS)[0]) for channel in there]
    plain = [re.sub(r"[./](pos|position)$", "", own, flags=re.IGNORECASE) for own in names]
    if plain.count(bare) == 1:
        return plain.index(bare)
    found = [i for i, other in enumerate(names) if is_joint(other, bare) or is_joint(bare, other)]
    # `Wrist_Pitch.pos` is no `Pitch` beside a `Wrist_Pitch`.
    longer = [joint for joint in wanted if len(joint) > len(bare)]
    found = [i for i in found if not any(is_joint(names[i], joint) for joint in longer)]
    measured = measured_of([there[i] for i in found]) if len(found) > 1 else None
    found = found if measured is None else [list(there).index(measured)]
    if len(found) > 1:
        raise InvalidDemonstrationsError(
            f"{say_names([there[i] for i in found])} all look like {name}; name the recorded ones "
            "with --joints"
        )
    if not found and is_opening(bare):
        found = [i for i, other in enumerate(names) if is_opening(other)]
    return found[0] if len(found) == 1 else None
