"""Members that the package's contract tests try."""

from __future__ import annotations

from typing import Any

from prior_reinforce.registry import Registry


def members(registry: Registry[Any]) -> list[str]:
    """Names of a family's members but those of the reproduction, which tries its own."""
    modules = {
        name: getattr(member.target, "__module__", member.target)
        for name, member in registry.members.items()
    }
    return [name for name, module in modules.items() if not module.startswith("reproduction")]
