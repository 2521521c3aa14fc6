"""Settings of the gate are checked, and say what each unit may be off."""

import numpy as np
import pytest

from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.errors import ConfigurationError


@pytest.mark.parametrize(
    "values",
    [
        {"warn_above": 0.0},
        {"beyond_warn": 2.0},
        {"rest_speed": -1.0},
        {"box_low": (0, 0, 0)},
        {"box_low": (0, 0, 0), "box_high": (1, 1, 0)},
        {"tool_tip": (0.0, np.nan, 0.0)},
        {"ranges": (("gripper", 1.0, 1.0),)},
        {"ranges": (("gripper", 0.0, np.nan),)},
        {"errors": (("percent", 0.0, 5.0),)},
        {"errors": (("percent", 5.0, np.nan),)},
        {"errors": (("percent", np.inf, 5.0),)},
    ],
)
def test_settings_are_checked(values):
    with pytest.raises(ConfigurationError):
        GateSettings(**values)


def test_what_columns_may_be_off_is_known_by_unit_or_not_at_all():
    given = GateSettings(start_error=0.03, errors=(("percent", 1.0, 2.0),))
    assert given.errors_of("rad") == (0.03, 0.01)
    assert given.errors_of("percent") == (1.0, 2.0)
    assert given.errors_of("m") == (0.01, 0.005)
    assert given.errors_of("steps") is None
