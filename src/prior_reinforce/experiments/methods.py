"""Members of the four families by their names, and one's own by `module:Class`."""

from __future__ import annotations

from typing import Literal

from prior_reinforce.adapters import make_adapter
from prior_reinforce.adapters.base import Adapter
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import Generator
from prior_reinforce.generators.by_name import make_generator
from prior_reinforce.perception import make_perception
from prior_reinforce.registry import import_and_make

__all__ = ["family_of", "make_adapter", "make_generator", "make_perception"]


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
