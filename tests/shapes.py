"""Arrays are held to their annotated shapes and kinds while the tests run."""

from __future__ import annotations

import functools
import inspect
import itertools
from collections.abc import Callable
from typing import Any, get_args

import jaxtyping
from beartype import beartype
from beartype.door import die_if_unbearable
from jaxtyping import AbstractArray, install_import_hook, jaxtyped

ALWAYS, SELDOM = 200, 50
"""Calls of a function in a process that are all checked, and which of the others."""


def check_shapes(package: str) -> None:
    """Hold the package, which nothing may have imported yet, to its annotated arrays.

    The import hook wraps every function, at 20 us a call, which was half of the suite's time on
    small ones; here only those are wrapped that have an array, and not checked at every call.
    """
    jaxtyping.jaxtyped = _wrapped_where_needed
    install_import_hook(package, "tests.shapes.arrays_only")


def _wrapped_where_needed(*, typechecker: Callable[..., Any]) -> Callable[..., Any]:
    def wrapped(made: Any) -> Any:
        if not inspect.isfunction(made):
            return jaxtyped(made, typechecker=typechecker)
        # A function within another is made at each call of that one, and is the same.
        place = (made.__module__, made.__qualname__, made.__code__.co_firstlineno)
        if place not in _CALLS:
            _CALLS[place] = itertools.count() if _takes_or_gives_arrays(made) else None
        calls = _CALLS[place]
        if calls is None:
            return made
        return _often(made, calls, functools.partial(jaxtyped, made, typechecker=typechecker))

    return wrapped


_CALLS: dict[tuple[str, str, int], itertools.count[int] | None] = {}
"""Of each function in a process, counted; None where no array goes in or out."""


def _often(
    made: Callable[..., Any], calls: itertools.count[int], check: Callable[[], Callable[..., Any]]
) -> Callable[..., Any]:
    """Check a function's first calls and some of those that follow.

    What checks is made at the first call that is checked: it takes 10 ms, and most are not called.
    """
    checked: Callable[..., Any] | None = None

    @functools.wraps(made)
    def call(*args: Any, **kwargs: Any) -> Any:
        nonlocal checked
        n = next(calls)
        if n >= ALWAYS and n % SELDOM:
            return made(*args, **kwargs)
        if checked is None:
            checked = check()
        return checked(*args, **kwargs)

    return call


def _takes_or_gives_arrays(function: Callable[..., Any]) -> bool:
    for hint in function.__annotations__.values():
        try:
            evaluated = eval(hint, function.__globals__) if isinstance(hint, str) else hint
        except (AttributeError, NameError):  # left to the hook, which knows such hints
            return True
        if _has_array(evaluated):
            return True
    return False


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
