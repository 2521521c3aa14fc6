"""Members by name: choices with settings, one's own, and what is wrong with a choice."""

import hashlib
from dataclasses import dataclass, field, replace
from typing import ClassVar

import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import make_generator
from prior_reinforce.generators.config import DiffusionConfig
from prior_reinforce.registry import Member, Registry, build, parse_choice, source_digest


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
        ("module:Class, gain = 0.5,x=", "module:Class", {"gain": "0.5", "x": ""}),
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


def test_ones_own_is_named_by_its_module():
    own = f"{__name__}:Plain"
    assert SAILS.make(f"{own},area=5").area == 5.0
    assert SAILS.name_of(SAILS.make(own)) == "plain"


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ("spinnaker", "no sail 'spinnaker'; known are plain, rigged, stiff, missing, or give"),
        ("plain,reef=1", "plain,reef=1 has no setting 'reef'; it has area, cloth, wet"),
        ("plain,area.x=1", "plain,area.x=1 has no setting 'area.x'; it has area, cloth, wet"),
        ("rigged,reef.x=1", "rigged,reef.x=1, reef, has no setting 'x'; it has"),
        ("plain,area=wide", "plain,area=wide: Expected `float`.*area"),
        ("rigged,mast=1", "has no setting 'mast'; it has battens, reef"),
        ("rigged,battens=many", "rigged,battens=many: .*battens"),
        ("rigged,battens=0", "battens must be at least 1"),
        ("missing", "cannot import nowhere:Sail: .*PYTHONPATH"),
        (f"{__name__}:Sails", "cannot find .*Sails.*check its spelling"),
        (f"{__name__}:Reef", "must derive from .*Sail"),
        ("pathlib:Path", "pathlib:Path must derive from .*Sail"),
    ],
)
def test_what_is_wrong_with_a_choice_is_said(choice, message):
    with pytest.raises(ConfigurationError, match=message):
        SAILS.make(choice)


def test_help_names_every_member_and_imports_none():
    assert SAILS.help == (
        "plain (a sheet), rigged (with battens), stiff (with many), missing (not installed), or "
        "your own as module:Class; settings as NAME,setting=value"
    )


def test_nested_settings_are_built_of_plain_values():
    assert build(RiggedConfig, {"reef": {"points": 2}}) == RiggedConfig(reef=Reef(2))
    with pytest.raises(ConfigurationError, match=r"RiggedConfig: .*reef\.points"):
        build(RiggedConfig, {"reef": {"points": "two"}})


def test_the_digest_follows_the_file_of_a_class_of_ones_own(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "own_sail.py").write_text("a = 1\n")
    assert source_digest("own_sail:Own,x=2") == hashlib.sha256(b"a = 1\n").hexdigest()
    assert source_digest("plain") == ""
    with pytest.raises(ConfigurationError, match="cannot find nowhere_sail:Own"):
        source_digest("nowhere_sail:Own")


class Racing(Rigged):
    """Shares a config, with defaults of its own."""

    def __init__(self, config: RiggedConfig | None = None) -> None:
        super().__init__(config or RiggedConfig(battens=12))


def test_a_class_keeps_its_own_defaults_where_nothing_is_set():
    assert SAILS.make(f"{__name__}:Racing").config.battens == 12
    assert SAILS.make(f"{__name__}:Racing,battens=2").config.battens == 2


class Optional(Sail):
    def __init__(self, memory: int | None = None, gain: float = 1) -> None:
        self.memory, self.gain = memory, gain


def test_plain_settings_are_read_by_their_annotations():
    made = SAILS.make(f"{__name__}:Optional,memory=3,gain=0.5")
    assert (made.memory, made.gain) == (3, 0.5)
    assert SAILS.make(f"{__name__}:Optional,memory=none").memory is None
    with pytest.raises(ConfigurationError, match="gain"):
        SAILS.make(f"{__name__}:Optional,gain=none")


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
    made = make_generator("diffusion,network.widths=8:16,timing=none")
    laptop = DiffusionConfig().network
    assert made.config.network == replace(laptop, widths=(8, 16))
