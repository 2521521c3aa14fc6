"""Numbers that leap in mid-motion are refused; grippers, switches and lost frames are none."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings.leaps import refuse_leaps
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.errors import InvalidDemonstrationsError
from tests.arm.recordings.recorded import sampled


def course(rate):
    t = np.arange(2 * rate) / rate
    s = np.clip(t - 0.4, 0, 1)
    return t, 10 * s**3 - 15 * s**4 + 6 * s**5


def check(t, values, unit, name="pan"):
    values = np.column_stack([values])
    names = (name, "p2", "p3")[: values.shape[1]]
    units = (unit,) * len(names)
    refuse_leaps([Recording("7", t, values, names, units=units)], units)


@pytest.mark.parametrize("rate", [20, 100, 500])
@pytest.mark.parametrize(
    ("count", "start", "way"),
    [
        (4096, 3700, 800),
        (4096, 300, -700),
        (65536, 65000, 20000),
        (1024, 1010, 40),
        (360, 300, 200),
    ],
)
def test_a_counter_that_starts_again_is_refused(rate, count, start, way):
    t, s = course(rate)
    said = rf"episode 7: pan leaps from \S+ to \S+ ticks at .*counts to {count} .*--joints"
    with pytest.raises(InvalidDemonstrationsError, match=said):
        check(t, np.round(start + way * s) % count, "ticks")


def test_what_moves_on_after_a_leap_is_refused():
    t, s = course(100)
    with pytest.raises(InvalidDemonstrationsError, match=r"from 0.3\S* to 1.3\S* m at .*before"):
        check(t, 0.3 * s + 0.5 + 1.0 * (t > 0.9) - 0.33, "m", "slide")


def test_two_angles_that_flip_in_one_frame_are_refused():
    t, s = course(100)
    flips = np.pi * (t > 0.8)
    with pytest.raises(
        InvalidDemonstrationsError, match=r"pan leaps .* and p3 leaps .*half a turn"
    ):
        check(t, np.column_stack([0.1 + flips, 0.4 * s, flips - 0.3]), "rad")


@pytest.mark.parametrize("rate", [10, 20, 100, 500])
@pytest.mark.parametrize("sigma", [0.0, 0.003])
def test_steps_between_rests_and_lost_frames_are_none(rate, sigma):
    t, s = course(rate)
    rng = np.random.default_rng(rate)
    for _ in range(3):
        noise = sigma * rng.normal(size=t.size)
        check(t, (t > 0.9) + noise, "A", "magnet")
        check(t, 0.08 * (t > 0.9) + 0.08 * np.exp(-8 * np.maximum(t - 0.9, 0)) + noise, "m", "lift")
        check(t, np.minimum(s, 0.5) + 0.5 * (t > 0.9) + noise, "m", "lift")
        check(t, s + noise, "rad")
        kept = (t < 0.7) | (t > 1.1)
        check(t[kept], (s + noise)[kept], "rad")
        held = np.floor(t * 5) / 5
        check(t, np.interp(held, t, s) + noise, "rad")
    for i in range(6):
        t, q = sampled(i, rate)
        refuse_leaps([Recording("7", t, q)], ("rad",) * q.shape[1])
