"""Members of the four families by their names, and one's own by `module:Class`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

from prior_reinforce.adapters import (
    Adapter,
    FrozenAdapter,
    GaussianProcessAdapter,
    GaussianProcessConfig,
    ProportionalAdapter,
)
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import Generator, make_generator
from prior_reinforce.perception import Amplified, Exact, Eye, Perception
from prior_reinforce.registry import import_and_make, make_own

__all__ = ["family_of", "make_adapter", "make_generator", "make_perception"]


def make_adapter(name: str) -> Adapter:
    """Make an adapter by its name, or one's own by `module:Class`.

    `gp` is ours with m = 2; `gp-all` keeps every trial (m = infinity). `gp-one-term` and
    `gp-one-term-all` put one fixed size on the whole diagonal, as the paper writes it.

    Raises:
        ConfigurationError: There is no such adapter.
    """
    one_term = GaussianProcessConfig(trial_jitter=1e-3, demonstration_jitter_bounds=(1e-3, 1e-3))
    known: dict[str, Callable[[], Adapter]] = {
        "gp": GaussianProcessAdapter,
        "gp-all": lambda: GaussianProcessAdapter(GaussianProcessConfig(memory_size=None)),
        "gp-one-term": lambda: GaussianProcessAdapter(one_term),
        "gp-one-term-all": lambda: GaussianProcessAdapter(replace(one_term, memory_size=None)),
        "proportional": ProportionalAdapter,
        "frozen": FrozenAdapter,
    }
    if name in known:
        return known[name]()
    return make_own(name, Adapter, list(known))


def make_perception(name: str) -> Perception:
    """Make a perception by its name, or one's own by `module:Class`.

    Raises:
        ConfigurationError: There is no such perception.
    """
    known = {"exact": Exact, "eye": Eye, "amplified": Amplified}
    if name in known:
        return known[name]()
    return make_own(name, Perception, list(known))


def family_of(name: str) -> Literal["generator", "adapter"]:
    """Which family one's own `module:Class` joins in a comparison.

    Raises:
        ConfigurationError: It cannot be made, or is neither a generator nor an adapter.
    """
    if ":" not in name:
        raise ConfigurationError(f"expected one's own method as module:Class, got {name!r}")
    made = import_and_make(name)
    if isinstance(made, Generator):
        return "generator"
    if isinstance(made, Adapter):
        return "adapter"
    raise ConfigurationError(
        f"{name} is neither a Generator nor an Adapter; only these are compared side by side"
    )
