"""Members of the four families by their names, and one's own by `module:Class`."""

from __future__ import annotations

import importlib
from typing import Any

from prior_reinforce.adapters import (
    Adapter,
    FrozenAdapter,
    GaussianProcessAdapter,
    GaussianProcessConfig,
    ProportionalAdapter,
)
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import FAMILY as GENERATORS
from prior_reinforce.generators import DiffusionGenerator, Generator
from prior_reinforce.perception import Amplified, Exact, Eye, Perception


def make_generator(name: str) -> Generator:
    """Make a generator by its name, or one's own by `module:Class`.

    Raises:
        ConfigurationError: There is no such generator.
    """
    known = {kind.name: kind for kind in GENERATORS}
    if name == DiffusionGenerator.name:
        # One core each, so that the last digits do not depend on how many there are.
        return DiffusionGenerator(threads=1)
    if name in known:
        return known[name]()
    return _imported(name, Generator, list(known))


def make_adapter(name: str) -> Adapter:
    """Make an adapter by its name, or one's own by `module:Class`.

    `gp` is the paper's with m = 2; `gp-all` keeps every trial (m = infinity).

    Raises:
        ConfigurationError: There is no such adapter.
    """
    if name == "gp":
        return GaussianProcessAdapter()
    if name == "gp-all":
        return GaussianProcessAdapter(GaussianProcessConfig(memory_size=None))
    if name == "proportional":
        return ProportionalAdapter()
    if name == "frozen":
        return FrozenAdapter()
    return _imported(name, Adapter, ["gp", "gp-all", "proportional", "frozen"])


def make_perception(name: str) -> Perception:
    """Make a perception by its name, or one's own by `module:Class`.

    Raises:
        ConfigurationError: There is no such perception.
    """
    known = {"exact": Exact, "eye": Eye, "amplified": Amplified}
    if name in known:
        return known[name]()
    return _imported(name, Perception, list(known))


def _imported(name: str, family: Any, known: list[str]) -> Any:
    module, _, attribute = name.partition(":")
    if not attribute:
        raise ConfigurationError(
            f"no {family.__name__.lower()} {name!r}; known are {', '.join(known)}, or give your "
            "own as module:Class"
        )
    try:
        kind = getattr(importlib.import_module(module), attribute)
        made = kind()
    except (ImportError, AttributeError, TypeError) as error:
        raise ConfigurationError(
            f"cannot make {name}: {error}; it must be importable from here (PYTHONPATH) and need "
            "no arguments"
        ) from error
    if not isinstance(made, family):
        raise ConfigurationError(f"{name} is no {family.__name__}; derive it from that class")
    return made
