"""The members of a family by name: what can be chosen, what it is set to, how it is made.

A family's `__init__` holds its one `Registry`. The command line's choices and help texts, saving
and loading follow from it. A member of ours is named by its module, so that a list of names imports
none of them. A class of one's own is added by the module that defines it (`Registry.add`); which
modules are imported for that, a person says: `--plugins MODULE`, or the variable
`PRIOR_REINFORCE_PLUGINS`. So nothing that is read from a file starts code.

A class with settings takes a `config`, a frozen dataclass that its `config_type` names; one without
may take plain arguments. A choice is written `name`, or `name,setting=value,...`: `gp`,
`gp,memory_size=none`, `diffusion,network.widths=64:128`.
"""

from __future__ import annotations

import importlib
import inspect
import operator
import os
import pkgutil
import re
import typing
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, is_dataclass
from typing import Any, Generic, TypeVar, cast

from prior_reinforce.errors import ConfigurationError, one_of
from prior_reinforce.extras import missing_extra

T = TypeVar("T")
PLUGINS = "PRIOR_REINFORCE_PLUGINS"
"""Environment variable that names modules to import, separated by commas; a person sets it."""


@dataclass(frozen=True)
class Member:
    """One name of a family."""

    target: str | type[Any]
    """The class, or `module:Class`, imported when it is first used."""
    summary: str
    """What it is, in a few words, for help texts."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Where it differs from the defaults of its class."""


class Registry(Generic[T]):
    """All members of one family."""

    def __init__(self, family: str, base: str, members: Mapping[str, Member]) -> None:
        """Name a family: what a member is called in messages, its base `module:Class`, its members.

        They are by name, in the order of help texts.
        """
        self.family = family
        self.members = dict(members)
        self._base = base

    def add(self, name: str, member: Member | type[T]) -> None:
        """Let a class of one's own be chosen by a name, in this process.

        Args:
            name: What it is chosen by; of a generator, its `name`, by which models are loaded.
                Replaces a member of that name.
            member: The class, described in help texts by its docstring's first line; or a `Member`.
        """
        if not isinstance(member, Member):
            member = Member(member, (inspect.getdoc(member) or name).partition("\n")[0].rstrip("."))
        self.members[name] = member

    @property
    def help(self) -> str:
        """The choices in one sentence, for help texts."""
        known = ", ".join(f"{name} ({m.summary})" for name, m in self.members.items())
        return f"{known}; settings as NAME,setting=value"

    def make(self, choice: str, **context: Any) -> T:
        """Make a member.

        Args:
            choice: Its name, with settings if need be: `gp,memory_size=4`.
            context: What a member may need beside its settings; given to those that take it.

        Raises:
            ConfigurationError: There is no such member, a setting that it does not have, or a value
                that the setting cannot have.
        """
        name, settings = parse_choice(choice)
        settings = {**self._member(name).settings, **settings}
        return self._make(name, settings, context, choice)

    def _make(
        self, name: str, settings: Mapping[str, Any], context: Mapping[str, Any], choice: str
    ) -> T:
        """Make a member; errors of its constructor pass through. `choice` is for messages."""
        kind = self._class(name)
        takes = inspect.signature(kind).parameters
        arguments = {key: value for key, value in context.items() if key in takes}
        config = getattr(kind, "config_type", None)
        if config is None:
            arguments |= _arguments(kind, settings, choice)
        else:
            given = arguments.pop("config", None)
            if isinstance(given, config):  # settings in the choice come on top
                settings = {**asdict(given), **settings}
            if settings:  # else the class's own defaults, which may differ from its config's
                arguments["config"] = build(config, settings, choice)
        try:
            inspect.signature(kind).bind(**arguments)
        except TypeError as error:
            raise ConfigurationError(
                f"cannot make {choice}: {error}; add it as a setting"
            ) from error
        return kind(**arguments)

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
        return self._class(parse_choice(choice)[0])

    def name_of(self, made: T) -> str | None:
        """Return the name of a member's class; None where it has none."""
        kind = type(made)
        targets = (kind, f"{kind.__module__}:{kind.__qualname__}")
        return next((name for name, m in self.members.items() if m.target in targets), None)

    def _member(self, name: str) -> Member:
        if name not in self.members:
            load_plugins()  # in a process that has not yet
        if name not in self.members:
            raise ConfigurationError(
                f"no {self.family} {name!r}; known are {', '.join(self.members)}; a class of your "
                "own is registered by the module that --plugins names"
            )
        return self.members[name]

    def _class(self, name: str) -> type[T]:
        target = self._member(name).target
        kind = _resolve(target) if isinstance(target, str) else target
        base = pkgutil.resolve_name(self._base)
        if not (isinstance(kind, type) and issubclass(kind, base)):
            raise ConfigurationError(f"{name} must derive from {self._base.replace(':', '.')}")
        return kind


def load_plugins(*modules: str) -> None:
    """Import modules that register classes of one's own, and those that `PLUGINS` names.

    Programs that are started from here, such as an executor's, are told of them by that variable.
    ConfigurationError if there is no such module.
    """
    named = dict.fromkeys(filter(None, (*os.environ.get(PLUGINS, "").split(","), *modules)))
    for name in named:
        try:
            importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name is None or f"{name}.".startswith(f"{error.name}."):
                raise ConfigurationError(
                    f"there is no module {name}; it must be importable from here (PYTHONPATH)"
                ) from error
            raise
    if modules:
        os.environ[PLUGINS] = ",".join(named)


def parse_choice(choice: str) -> tuple[str, dict[str, str]]:
    """Split `name,setting=value,...` into the name and its settings.

    ConfigurationError for no text, a setting without a value, or one given twice.
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


def build(config: type[Any], settings: Mapping[str, Any], choice: str = "") -> Any:
    """Make a dataclass of settings from plain values: numbers as text, lists for tuples.

    All fields of `config` have defaults; one that is a dataclass takes a mapping. `choice` is what
    was asked for, for messages. ConfigurationError for an unknown setting, or a value of a wrong
    type or out of range.
    """
    import msgspec

    choice = choice or config.__name__
    try:
        return msgspec.convert(_plain(config, settings, choice), config, strict=False)
    except msgspec.ValidationError as error:
        named = re.search(r"`\$\.(\w+)(?:\[\d+\])?`$", str(error))
        remedy = one_of(typing.get_type_hints(config)[named[1]]) if named else ""
        raise ConfigurationError(f"{choice}: {error}{remedy}") from error


def _arguments(kind: type[Any], settings: Mapping[str, Any], choice: str) -> dict[str, Any]:
    """Plain arguments of a constructor, read by its annotations as a dataclass of settings is."""
    import msgspec

    hints, made = typing.get_type_hints(kind.__init__), dict[str, Any]()
    for name, value in _plain(kind.__init__, settings, choice).items():
        try:
            made[name] = msgspec.convert(value, hints[name], strict=False)
        except msgspec.ValidationError as error:
            raise ConfigurationError(f"{choice}: {error} for {name}") from error
    return made


def _plain(taker: Callable[..., Any], settings: Mapping[str, Any], choice: str) -> dict[str, Any]:
    """Settings as msgspec takes them: `none`, `64:128` for a tuple, `network.kernel` for a part."""
    hints = typing.get_type_hints(taker)
    hints.pop("return", None)
    plain: dict[str, Any] = {}
    for key, value in settings.items():
        outer, _, inner = key.partition(".")
        part = bool(inner) and is_dataclass(hints.get(outer))
        if outer not in hints or (inner and not part):
            known = ", ".join(hints) or "none"
            raise ConfigurationError(f"{choice} has no setting {key!r}; it has {known}")
        hint = hints[outer]
        kinds: list[Any] = [typing.get_origin(each) for each in (hint, *typing.get_args(hint))]
        if part:
            whole = plain[outer] if outer in plain else asdict(getattr(taker(), outer))
            plain[outer] = {
                **whole,
                **_plain(cast(type[Any], hint), {inner: value}, f"{choice}, {outer},"),
            }
        elif value in ("none", "None") and hint is not str:
            plain[outer] = None
        elif isinstance(value, str) and tuple in kinds:
            plain[outer] = value.split(":")
        else:
            plain[outer] = value
    return plain


def _resolve(target: str) -> Any:
    module, _, name = target.partition(":")
    try:
        found = importlib.import_module(module)
    except (ImportError, ValueError) as error:
        missing = missing_extra(error) if isinstance(error, ImportError) else None
        if missing is not None:
            raise missing from error
        raise ConfigurationError(
            f"cannot import {target}: {error}; it must be importable from here (PYTHONPATH)"
        ) from error
    try:
        return operator.attrgetter(name)(found)
    except AttributeError as error:
        raise ConfigurationError(f"cannot find {target}: {error}; check its spelling") from error
