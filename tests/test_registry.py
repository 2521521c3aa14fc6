"""Members by name: choices with settings, one's own, and what is wrong with a choice."""

import sys
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import make_generator
from prior_reinforce.generators.network.config import DiffusionConfig
from prior_reinforce.registry import (
    PLUGINS,
    Member,
    Registry,
    build,
    load_plugins,
    parse_choice,
)


class Sail:
    """The family's base class."""


class Plain(Sail):
    def __init__(self, area: float = 2.0, cloth: str = "cotton", wet: bool = False) -> None:
        self.area, self.cloth, self.wet = area, cloth, wet


@dataclass(frozen=True)
class Reef:
    points: int = 3


@dataclass(frozen=True)
class RiggedConfig:
    battens: int | None = 4
    reef: Reef = field(default_factory=Reef)

    def __post_init__(self) -> None:
        if self.battens == 0:
            raise ValueError("battens must be at least 1, got 0")


class Rigged(Sail):
    config_type: ClassVar[type[RiggedConfig]] = RiggedConfig

    def __init__(self, config: RiggedConfig | None = None, wind: float = 0.0) -> None:
        self.config, self.wind = config or RiggedConfig(), wind


SAILS: Registry[Sail] = Registry(
    "sail",
    f"{__name__}:Sail",
    {
        "plain": Member(f"{__name__}:Plain", "a sheet"),
        "rigged": Member(f"{__name__}:Rigged", "with battens"),
        "stiff": Member(f"{__name__}:Rigged", "with many", {"battens": 9}),
        "missing": Member("nowhere:Sail", "not installed"),
    },
)


@pytest.mark.parametrize(
    ("choice", "name", "settings"),
    [
        ("gp", "gp", {}),
        ("gp,memory-size=none", "gp", {"memory_size": "none"}),
        ("drift, gain = 0.5,x=", "drift", {"gain": "0.5", "x": ""}),
    ],
)
def test_a_choice_is_a_name_and_settings(choice, name, settings):
    assert parse_choice(choice) == (name, settings)


@pytest.mark.parametrize("choice", ["gp,gain", "gp,=1", "gp,gain=1,gain=2"])
def test_a_setting_that_cannot_be_read_is_shown(choice):
    with pytest.raises(ConfigurationError, match="as setting=value"):
        parse_choice(choice)


def test_plain_settings_have_the_type_of_their_default():
    sail = SAILS.make("plain,area=3,cloth=7,wet=true")
    assert (sail.area, sail.cloth, sail.wet) == (3.0, "7", True)
    assert SAILS.make("plain,wet=false").wet is False


def test_settings_of_a_config_come_on_top_of_the_members_and_of_one_that_is_given():
    assert SAILS.make("rigged").config == RiggedConfig()
    assert SAILS.make("stiff").config.battens == 9
    assert SAILS.make("stiff,battens=none").config.battens is None
    given = RiggedConfig(battens=2, reef=Reef(1))
    assert SAILS.make("rigged", config=given).config == given
    assert SAILS.make("rigged,battens=5", config=given).config == RiggedConfig(5, Reef(1))


def test_a_member_gets_what_it_takes_of_the_context():
    assert SAILS.make("rigged", wind=3.0, boat="dinghy").wind == 3.0
    assert SAILS.make("plain", wind=3.0).area == 2.0


@pytest.fixture
def add(monkeypatch):
    """Adds a class to the family for one test."""
    monkeypatch.setattr(SAILS, "members", dict(SAILS.members))
    return SAILS.add


def test_ones_own_is_added_by_its_class(add):
    add("racing", Racing)
    assert SAILS.make("racing,battens=5").config.battens == 5
    assert SAILS.name_of(SAILS.make("racing")) == "racing"
    assert SAILS.name_of(SAILS.make("plain")) == "plain"
    assert "racing (Shares a config, with defaults of its own)" in SAILS.help


def test_a_plugin_registers_when_a_person_names_it(add, tmp_path, monkeypatch):
    (tmp_path / "own_sail.py").write_text(
        f"from {__name__} import SAILS, Plain\nSAILS.add('mine', type('Mine', (Plain,), {{}}))\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(sys.modules, __name__, sys.modules[__name__])
    with pytest.raises(ConfigurationError, match=r"no sail 'mine'; .*--plugins"):
        SAILS.make("mine")
    monkeypatch.setenv(PLUGINS, "own_sail")  # as in a process that is started by another
    assert SAILS.make("mine,area=3").area == 3.0
    with pytest.raises(ConfigurationError, match=r"no module nowhere_sail; .*PYTHONPATH"):
        load_plugins("nowhere_sail")


def test_errors_of_ones_own_constructor_pass_through(add):
    add("broken", Broken)
    with pytest.raises(ValueError, match="a bug") as caught:
        SAILS.make("broken,area=1")
    assert not isinstance(caught.value, ConfigurationError)
    with pytest.raises(ConfigurationError, match="missing a required argument: 'area'"):
        SAILS.make("broken")


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ("spinnaker", "no sail 'spinnaker'; known are plain, rigged, stiff, missing, .*--plugins"),
        ("plain,reef=1", "plain,reef=1 has no setting 'reef'; it has area, cloth, wet"),
        ("plain,area.x=1", "plain,area.x=1 has no setting 'area.x'; it has area, cloth, wet"),
        ("rigged,reef.x=1", "rigged,reef.x=1, reef, has no setting 'x'; it has"),
        ("plain,area=wide", "plain,area=wide: Expected `float`.*area"),
        ("rigged,mast=1", "has no setting 'mast'; it has battens, reef"),
        ("rigged,battens=many", "rigged,battens=many: .*battens"),
        ("rigged,battens=0", "battens must be at least 1"),
        ("missing", "cannot import nowhere:Sail: .*PYTHONPATH"),
        ("misspelt", "cannot find .*Sails.*check its spelling"),
        ("other", "other must derive from .*Sail"),
    ],
)
def test_what_is_wrong_with_a_choice_is_said(add, choice, message):
    add("misspelt", Member(f"{__name__}:Sails", "no class"))
    add("other", Reef)
    with pytest.raises(ConfigurationError, match=message):
        SAILS.make(choice)


def test_help_names_every_member_and_imports_none():
    assert SAILS.help == (
        "plain (a sheet), rigged (with battens), stiff (with many), missing (not installed); "
        "settings as NAME,setting=value"
    )


def test_nested_settings_are_built_of_plain_values():
    assert build(RiggedConfig, {"reef": {"points": 2}}) == RiggedConfig(reef=Reef(2))
    with pytest.raises(ConfigurationError, match=r"RiggedConfig: .*reef\.points"):
        build(RiggedConfig, {"reef": {"points": "two"}})


class Broken(Sail):
    def __init__(self, area: float) -> None:
        raise ValueError("a bug")


class Racing(Rigged):
    """Shares a config, with defaults of its own."""

    def __init__(self, config: RiggedConfig | None = None) -> None:
        super().__init__(config or RiggedConfig(battens=12))


def test_a_class_keeps_its_own_defaults_where_nothing_is_set(add):
    add("racing", Racing)
    assert SAILS.make("racing").config.battens == 12
    assert SAILS.make("racing,battens=2").config.battens == 2


class Optional(Sail):
    def __init__(self, memory: int | None = None, gain: float = 1) -> None:
        self.memory, self.gain = memory, gain


def test_plain_settings_are_read_by_their_annotations(add):
    add("optional", Optional)
    made = SAILS.make("optional,memory=3,gain=0.5")
    assert (made.memory, made.gain) == (3, 0.5)
    assert SAILS.make("optional,memory=none").memory is None
    with pytest.raises(ConfigurationError, match="gain"):
        SAILS.make("optional,gain=none")


@dataclass(frozen=True)
class NamedConfig:
    fault: str = ""


def test_a_text_may_be_the_word_none():
    assert build(NamedConfig, {"fault": "none"}).fault == "none"


@dataclass(frozen=True)
class WovenConfig:
    threads: tuple[int, ...] = (4, 4)
    angles: tuple[float, float] | None = None
    reef: Reef = field(default_factory=lambda: Reef(points=7))


def test_tuples_and_parts_can_be_written_in_a_choice():
    _, settings = parse_choice("woven,threads=8:16:8,angles=0.5:1e-3")
    assert build(WovenConfig, settings) == WovenConfig((8, 16, 8), (0.5, 1e-3))
    _, settings = parse_choice("woven,reef.points=2,angles=none")
    assert build(WovenConfig, settings) == WovenConfig(reef=Reef(2))
    with pytest.raises(ConfigurationError, match=r"no setting 'sail\.points'"):
        build(WovenConfig, {"sail.points": "2"})


def test_a_part_of_a_network_leaves_the_rest_as_it_is_set():
    made = make_generator("diffusion,network.widths=8:16,timing=none,symmetry=none")
    laptop = DiffusionConfig().network
    assert made.config.network == replace(laptop, widths=(8, 16))


@pytest.mark.parametrize(
    ("given", "remedy"),
    [({"cloth": "silk"}, True), ({"lining": "silk"}, True), ({"gain": "silk"}, False)],
)
def test_words_are_told_for_a_remedy_where_nothing_but_words_will_do(given, remedy):
    @dataclass(frozen=True)
    class Cut:
        cloth: Literal["cotton", "linen"] = "cotton"
        lining: Literal["cotton", "linen"] | None = None
        gain: float | Literal["cotton", "linen"] = 1.0

    with pytest.raises(ConfigurationError) as caught:
        build(Cut, given)
    assert ("cotton, linen" in str(caught.value)) == remedy
