"""The members of a family by name: what can be chosen, what it is set to, how it is made.

A family's `__init__` holds its one `Registry`. The command line's choices and help texts,
`reproduce`, saving and loading, and anyone's own `module:Class` follow from it. A member is named
by its module, so that a list of names imports none of them.

A class with settings takes a `config`, a frozen dataclass that its `config_type` names; one without
may take plain arguments. A choice is written `name`, or `name,setting=value,...`: `gp`,
`gp,memory_size=none`, `diffusion,network.widths=64:128`, `my_module:MyAdapter,gain=0.5`.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import pkgutil
import typing
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, is_dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.extras import missing_extra

T = TypeVar("T")


@dataclass(frozen=True)
class Member:
    """One name of a family."""

    target: str
    """`module:Class`."""
    summary: str
    """What it is, in a few words, for help texts."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Where it differs from the defaults of its class."""


class Registry(Generic[T]):
    """All members of one family."""

    def __init__(self, family: str, base: str, members: Mapping[str, Member]) -> None:
        """Name a family.

        Args:
            family: What a member is called, for messages: `adapter`.
            base: `module:Class` that every member derives from.
            members: By name, in the order of help texts.
        """
        self.family = family
        self.members = dict(members)
        self._base = base

    @property
    def help(self) -> str:
        """The choices in one sentence, for help texts."""
        ours = ", ".join(f"{name} ({m.summary})" for name, m in self.members.items())
        return f"{ours}, or your own as module:Class; settings as NAME,setting=value"

    def make(self, choice: str, **context: Any) -> T:
        """Make a member.

        Args:
            choice: `name` or `module:Class`, each with settings if need be: `gp,memory_size=4`.
            context: What a member may need beside its settings; given to those that take it.

        Raises:
            ConfigurationError: There is no such member, a setting that it does not have, or a value
                that the setting cannot have.
        """
        name, given = parse_choice(choice)
        kind, member = self.resolve(name), self.members.get(name)
        settings = {**(member.settings if member is not None else {}), **given}
        takes = inspect.signature(kind).parameters
        context = {key: value for key, value in context.items() if key in takes}
        config = getattr(kind, "config_type", None)
        given_config = context.pop("config", None)
        try:
            if config is None:
                return kind(**context, **_arguments(kind, settings, choice))
            if isinstance(given_config, config):  # settings in the choice come on top
                settings = {**asdict(given_config), **settings}
            if settings:  # else the class's own defaults, which may differ from its config's
                context["config"] = build(config, settings, choice)
            return kind(**context)
        except (TypeError, ValueError) as error:
            if isinstance(error, ConfigurationError):
                raise
            raise ConfigurationError(f"cannot make {choice}: {error}") from error

    def check(self, choice: str) -> None:
        """Do nothing if a choice can be made; a bare name of ours is not imported for that.

        Raises:
            ConfigurationError: As `make` does.
        """
        if choice not in self.members:
            self.make(choice)

    def resolve(self, choice: str) -> type[T]:
        """Return the class of a member; it is imported now.

        Raises:
            ConfigurationError: It is unknown, cannot be imported, or is of another family.
            MissingExtraError: It needs a library of an extra that is not installed.
        """
        name, _ = parse_choice(choice)
        member = self.members.get(name)
        if member is None and ":" not in name:
            raise ConfigurationError(
                f"no {self.family} {name!r}; known are {', '.join(self.members)}, or give your own "
                "as module:Class"
            )
        kind = _resolve(name if member is None else member.target)
        base = pkgutil.resolve_name(self._base)
        if not (isinstance(kind, type) and issubclass(kind, base)):
            raise ConfigurationError(f"{name} must derive from {self._base.replace(':', '.')}")
        return kind

    def name_of(self, made: T) -> str:
        """Return the name of a member's class, or `module:Class` where it is not ours."""
        target = f"{type(made).__module__}:{type(made).__qualname__}"
        return next((n for n, m in self.members.items() if m.target == target), target)


def parse_choice(choice: str) -> tuple[str, dict[str, str]]:
    """Split `name,setting=value,...` into the name and its settings.

    Raises:
        ConfigurationError: No text, a setting without a value, or one given twice.
    """
    if not isinstance(choice, str):
        raise ConfigurationError(f"a choice is a name such as 'auto', got {choice!r}; give one")
    name, *parts = choice.split(",")
    settings: dict[str, str] = {}
    for part in parts:
        key, equals, value = part.partition("=")
        key = key.strip().replace("-", "_")
        if not (equals and key) or key in settings:
            raise ConfigurationError(
                f"cannot read {part!r} in {choice!r}; write each setting once, as setting=value"
            )
        settings[key] = value.strip()
    return name.strip(), settings


def own_class(choice: str) -> str | None:
    """`module:Class` where a choice names a class of one's own; None where it is ours."""
    name, _ = parse_choice(choice)
    return name if ":" in name else None


def build(config: type[Any], settings: Mapping[str, Any], choice: str = "") -> Any:
    """Make a dataclass of settings from plain values: numbers as text, lists for tuples.

    Args:
        config: Frozen dataclass whose fields all have defaults.
        settings: By name; a field that is a dataclass takes a mapping.
        choice: What was asked for, for messages.

    Raises:
        ConfigurationError: An unknown setting, or a value of a wrong type or out of range.
    """
    import msgspec

    choice = choice or config.__name__
    try:
        return msgspec.convert(_plain(config, settings, choice), config, strict=False)
    except msgspec.ValidationError as error:
        raise ConfigurationError(f"{choice}: {error}") from error


def _arguments(kind: type[Any], settings: Mapping[str, Any], choice: str) -> dict[str, Any]:
    """Plain arguments of a constructor, read by its annotations as a dataclass of settings is."""
    import msgspec

    hints = typing.get_type_hints(kind.__init__)
    hints.pop("return", None)
    for name in settings:
        if name not in hints:
            known = ", ".join(hints) or "none"
            raise ConfigurationError(f"{choice} has no setting {name!r}; it has {known}")
    fields = [(name, hints[name] if name in settings else Any, None) for name in hints]
    made = build(msgspec.defstruct(kind.__name__, fields), settings, choice)
    return {name: getattr(made, name) for name in settings}


def _plain(config: type[Any], settings: Mapping[str, Any], choice: str) -> dict[str, Any]:
    """Settings as msgspec takes them: `none`, `64:128` for a tuple, `network.kernel` for a part."""
    hints = typing.get_type_hints(config)
    plain: dict[str, Any] = {}
    for key, value in settings.items():
        outer, _, inner = key.partition(".")
        if outer not in hints:
            known = ", ".join(hints) or "none"
            raise ConfigurationError(f"{choice} has no setting {key!r}; it has {known}")
        hint = hints[outer]
        kinds: list[Any] = [typing.get_origin(each) for each in (hint, *typing.get_args(hint))]
        if inner and is_dataclass(hint):
            whole = plain[outer] if outer in plain else asdict(getattr(config(), outer))
            plain[outer] = {
                **whole,
                **_plain(cast(type[Any], hint), {inner: value}, f"{choice}, {outer},"),
            }
        elif value in ("none", "None"):
            plain[outer] = None
        elif isinstance(value, str) and tuple in kinds:
            plain[outer] = value.split(":")
        else:
            plain[key] = value
    return plain


def source_digest(choice: str) -> str:
    """Return a hash of the file that a class of one's own stands in; empty for one of ours.

    Raises:
        ConfigurationError: The module cannot be found.
    """
    name, _ = parse_choice(choice)
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


def _resolve(target: str) -> Any:
    try:
        return pkgutil.resolve_name(target)
    except AttributeError as error:
        raise ConfigurationError(f"cannot find {target}: {error}; check its spelling") from error
    except (ImportError, ValueError) as error:
        missing = missing_extra(error) if isinstance(error, ImportError) else None
        if missing is not None:
            raise missing from error
        raise ConfigurationError(
            f"cannot import {target}: {error}; it must be importable from here (PYTHONPATH)"
        ) from error
