"""Members of the four families that are not ours: a class of one's own, by `module:Class`."""

from __future__ import annotations

import hashlib
import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from prior_reinforce.errors import ConfigurationError


def make_own(name: str, family: Any, known: Sequence[str]) -> Any:
    """Make a member of a family from `module:Class`.

    Args:
        name: Of a class that can be imported from here and needs no arguments.
        family: The base class that it must have; abstract, which is why it is no `type[...]`.
        known: Names of our own members, for the message where `name` is none of them.

    Raises:
        ConfigurationError: It is no `module:Class`, cannot be made, or is of another family.
    """
    if ":" not in name:
        raise ConfigurationError(
            f"no {family.__name__.lower()} {name!r}; known are {', '.join(known)}, or give your "
            "own as module:Class"
        )
    made = import_and_make(name)
    if not isinstance(made, family):
        raise ConfigurationError(f"{name} is no {family.__name__}; derive it from that class")
    return made


def source_digest(name: str) -> str:
    """Return a digest of the file that a class of one's own stands in; empty for one of ours.

    Args:
        name: `module:Class`, or a name of ours.

    Raises:
        ConfigurationError: The module cannot be found.
    """
    module, colon, _ = name.partition(":")
    if not colon:
        return ""
    try:
        found = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        found = None
    if found is None or found.origin is None:
        raise ConfigurationError(
            f"cannot find {name}; it must be importable from here (PYTHONPATH)"
        )
    return hashlib.sha256(Path(found.origin).read_bytes()).hexdigest()


def import_and_make(name: str) -> Any:
    """Import `module:Class` and make one without arguments.

    Raises:
        ConfigurationError: It cannot be imported, or not be made without arguments.
    """
    module, _, attribute = name.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)()
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        raise ConfigurationError(
            f"cannot make {name}: {error}; it must be importable from here (PYTHONPATH) and need "
            "no arguments"
        ) from error
