import pytest

from prior_reinforce.adapters import ADAPTERS, make_adapter
from prior_reinforce.errors import ConfigurationError


@pytest.mark.parametrize(
    ("choice", "memory_size", "bounds"),
    [
        ("gp", 2, (1e-3, 1e-3)),
        ("gp-all", None, (1e-3, 1e-3)),
        ("gp-two-term", 2, (1e-3, 0.3)),
        ("gp-two-term-all", None, (1e-3, 0.3)),
        ("gp,memory_size=4", 4, (1e-3, 1e-3)),
    ],
)
def test_a_choice_is_what_its_name_says(choice, memory_size, bounds):
    config = make_adapter(choice).config
    assert config.memory_size == memory_size
    assert config.demonstration_jitter_bounds == bounds
    assert config.trial_jitter == 1e-3


def test_settings_in_the_choice_are_read_and_checked():
    assert make_adapter("proportional,gain=0.5").gain == 0.5
    with pytest.raises(ConfigurationError, match="memory_size must be at least 1"):
        make_adapter("gp,memory_size=0")
    with pytest.raises(ConfigurationError, match="gain must be a positive number"):
        make_adapter("proportional,gain=-1")


def test_the_help_names_every_choice():
    assert all(f"{name} (" in ADAPTERS.help for name in ADAPTERS.members)
