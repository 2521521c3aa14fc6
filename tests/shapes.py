"""Arrays are held to their annotated shapes and kinds while the tests run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, get_args

from beartype import beartype
from beartype.door import die_if_unbearable
from jaxtyping import AbstractArray


def arrays_only(function: Callable[..., Any]) -> Callable[..., Any]:
    """Beartype for a function's arrays; every other type is mypy's business.

    A constructor may take what it then checks and converts (a list, say), so there the fields are
    held to their annotations, once they are set.
    """
    hints = {name: hint for name, hint in function.__annotations__.items() if _has_array(hint)}
    if not hints:
        return function
    if function.__name__ == "__init__":
        return _fields_only(hints)
    function.__annotations__ = hints
    return beartype(function)


def _fields_only(hints: dict[str, Any]) -> Callable[..., None]:
    def check(made: object, *_: Any, **__: Any) -> None:
        for name, hint in hints.items():
            if hasattr(made, name):
                die_if_unbearable(getattr(made, name), hint)

    return check


def _has_array(hint: Any) -> bool:
    if isinstance(hint, type) and issubclass(hint, AbstractArray):
        return True
    return any(map(_has_array, get_args(hint)))
