"""The times of a table's rows, whatever they are called, or what is missing of them."""

from contextlib import nullcontext
from itertools import product

import numpy as np
import pandas as pd
import pytest

from prior_reinforce.arm.recordings import import_demonstrations, read_recordings
from prior_reinforce.arm.recordings.beside import moving_beside
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    UnclearUnitsError,
)
from tests.arm.recordings.recorded import (
    JOINTS,
    sampled,
)


@pytest.mark.slow
def test_an_index_without_a_name_is_the_time(tmp_path):
    """As `DataFrame.to_csv` writes one: of dates it is taken, of numbers only when it is said."""
    t, q = sampled(0, 100)
    start = pd.Timestamp("2026-11-21T10:00", tz="Europe/Berlin")
    frame = pd.DataFrame(q, columns=JOINTS, index=start + pd.to_timedelta(t, unit="s"))
    frame.to_csv(tmp_path / "0.csv")
    (recording,) = read_recordings(tmp_path)
    np.testing.assert_allclose(recording.times, t, atol=1e-9)
    assert (recording.names, recording.clock) == (JOINTS, "column 1 in ns")
    frame.set_axis(1000 * t).to_csv(tmp_path / "0.csv")
    with pytest.raises(UnclearUnitsError) as caught:
        read_recordings(tmp_path)
    assert caught.value.options == "--time-column 1 --time-unit ms"
    (recording,) = read_recordings(tmp_path, time_column="1", time_unit="ms")
    np.testing.assert_allclose(recording.times, t, atol=1e-9)
    frame.set_axis(np.arange(len(t)) + 40).to_csv(tmp_path / "0.csv")  # rows that were cut out
    (recording,) = read_recordings(tmp_path, rate=100, joints=JOINTS)
    np.testing.assert_allclose(recording.positions, q)
    assert recording.remarks == ()
    for how in ({}, {"time_column": "none"}):
        (recording,) = read_recordings(tmp_path, rate=100, **how)
        assert recording.names == JOINTS
        np.testing.assert_allclose(recording.positions, q)
        why = "column 1 left out, which rises with every row, as times and counters do"
        assert recording.remarks == (why,)


def test_dates_count_as_times(tmp_path):
    t, q = sampled(0, 100)
    start = pd.Timestamp("2026-11-21T10:59:59.5")
    frame = pd.DataFrame(q, columns=JOINTS)
    frame.insert(0, "timestamp", start + pd.to_timedelta(t, unit="s"))
    frame.to_csv(tmp_path / "0.csv", index=False, date_format="%Y-%m-%dT%H:%M:%S.%f")
    (recording,) = read_recordings(tmp_path)
    np.testing.assert_allclose(recording.times, t, atol=2e-6)


def test_the_column_of_times_may_be_named_or_left_unread(tmp_path):
    (tmp_path / "a.csv").write_text("clock,t,a\n0,5,1\n10,5,2\n20,5,4\n")
    (recording,) = read_recordings(tmp_path, time_column="clock", time_unit="ms", joints=["a"])
    np.testing.assert_allclose(recording.times, [0, 0.01, 0.02])
    (recording,) = read_recordings(tmp_path, time_column="none", rate=50, joints=["a"])
    np.testing.assert_allclose(recording.times, [0, 0.02, 0.04])


def recorded_at_50(path, head, first, rows=100):
    """A table of two joints, and a first column that is made of the times in [s]."""
    t = np.arange(rows) / 50
    joints = np.column_stack([np.sin(t), np.cos(t)])
    np.savetxt(
        path / "a.csv", np.column_stack([first(t), joints]), "%.9f", ",",
        header=f"{head},a,b", comments="",
    )  # fmt: skip


@pytest.mark.parametrize("head", ["tid [s]", "tid", "chrono_s"])
@pytest.mark.parametrize("late", [0.0, 0.004])
def test_whatever_tells_the_time_is_held_against_the_rate(tmp_path, head, late):
    recorded_at_50(tmp_path, head, lambda t: t + late * np.sin(40 * t))
    with pytest.raises(ConfigurationError, match=r"--rate 100, but tid|chrono.* says .* Hz; drop"):
        read_recordings(tmp_path, rate=100)
    (recording,) = read_recordings(tmp_path, rate=50)
    assert recording.names == ("a", "b")
    np.testing.assert_allclose(recording.times, np.arange(100) / 50, atol=0.005)


@pytest.mark.parametrize(("head", "origin"), [("unix", 1.7e9), ("recv", 50.0)])
def test_a_clock_of_any_name_that_contradicts_the_times_is_refused(tmp_path, head, origin):
    recorded_at_50(tmp_path, f"t,{head}", lambda t: np.column_stack([t, origin + 1.25 * t]))
    with pytest.raises(
        FileFormatError, match=f"t says 50 .*{head} steps by 0.025; .*-column t, or"
    ):
        read_recordings(tmp_path, joints=["a", "b"])
    if head == "unix":  # where no joints are known, only the size of its numbers says so
        with pytest.raises(FileFormatError, match="say which is the time"):
            read_recordings(tmp_path)
        assert read_recordings(tmp_path, time_column="t")[0].names == ("a", "b")
    assert read_recordings(tmp_path, joints=["a", "b"], time_column=head)[0].period > 0.024


@pytest.mark.parametrize("head", ["frame", "nr", ""])
def test_a_counter_that_skips_says_where_frames_are_missing(tmp_path, head):
    recorded_at_50(tmp_path, head, lambda t: np.round(t * 50) + 12 * (t > 0.99))
    (recording,) = read_recordings(tmp_path, rate=50)
    assert recording.names == ("a", "b")
    assert np.diff(recording.times).max() == pytest.approx(13 / 50)


def test_times_that_go_on_where_a_counter_skips_are_refused(tmp_path):
    recorded_at_50(
        tmp_path, "t,frame", lambda t: np.column_stack([t, np.round(t * 50) + 12 * (t > 0.99)])
    )
    with pytest.raises(FileFormatError, match=r"t and frame part by 0.24 s, most at frame 50"):
        read_recordings(tmp_path)
    assert read_recordings(tmp_path, time_column="t")[0].period == pytest.approx(0.02)


@pytest.mark.parametrize(("names", "part"), [("tv_sec,tv_usec", 1e6), ("secs,msecs", 1e3)])
def test_seconds_and_their_parts_are_one_time(tmp_path, names, part):
    recorded_at_50(
        tmp_path, names,
        lambda t: np.column_stack([np.floor(t + 7.31), np.round((t + 7.31) % 1 * part)]),
    )  # fmt: skip
    (recording,) = read_recordings(tmp_path)
    np.testing.assert_allclose(recording.times, np.arange(100) / 50, atol=1e-9)


def test_a_rail_at_constant_speed_is_a_channel_and_no_clock(tmp_path):
    t, q = sampled(0, 50)
    table = np.column_stack([t, q[:, 1], 0.1 + 0.25 * t, np.arange(len(t)) + 7, 1e3 * t + 5])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t,a,rail,n,ms", comments="")
    assert read_recordings(tmp_path)[0].names == ("a", "rail")
    assert [*moving_beside([read_recordings(tmp_path, joints=["a"])[0]])] == ["rail"]


def table(folder, head, columns, above=""):
    rows = [",".join(map(repr, map(float, row))) for row in np.column_stack(columns)]
    path = folder / "t.csv"
    path.write_text("\n".join([*([above] if above else []), head, *rows]) + "\n")
    return path


JITTER = np.cumsum(np.where(np.arange(60) % 3, 0.009, 0.012))
SWING = np.sin(np.linspace(0, 3, 60))


@pytest.mark.parametrize(("unit", "scale"), [("min", 60), ("h", 3600), ("minutes", 60)])
def test_times_in_minutes_and_hours(tmp_path, unit, scale):
    (one,) = read_recordings(table(tmp_path, f"Time [{unit}],a", [JITTER / scale, SWING]))
    np.testing.assert_allclose(one.times, JITTER - JITTER[0], atol=1e-9)


def test_a_unit_of_times_that_is_not_known_is_refused_by_its_name(tmp_path):
    path = table(tmp_path, "Time [fortnight],a", [JITTER, SWING])
    with pytest.raises(FileFormatError, match=r"in 'fortnight', which is no known .*--time-unit"):
        read_recordings(path)
    assert read_recordings(path, time_unit="s")[0].duration == pytest.approx(np.ptp(JITTER))
    assert read_recordings(table(tmp_path, "Time (relative),a", [JITTER, SWING]))


@pytest.mark.parametrize(
    ("whole", "part", "scale"),
    [("seconds", "nanos", 1e9), ("sec", "micros", 1e6), ("stamp_s", "stamp_millis", 1e3)],
)
def test_seconds_and_a_part_of_one_by_any_name(tmp_path, whole, part, scale):
    t = JITTER + 1_760_000_000
    parts = np.round((t % 1) * scale)
    (one,) = read_recordings(table(tmp_path, f"{whole},{part},a", [t // 1, parts, SWING]))
    np.testing.assert_allclose(one.times, JITTER - JITTER[0], atol=2 / scale + 1e-6)


def test_times_since_the_row_before_are_summed(tmp_path):
    steps = np.diff(JITTER, prepend=JITTER[0])
    for head, scale in (("dt", 1), ("dt_ms", 1000)):
        path = table(tmp_path, f"{head},a", [steps * scale, SWING])
        (one,) = read_recordings(path)
        np.testing.assert_allclose(one.times, JITTER - JITTER[0], atol=1e-9)
        assert one.names == ("a",)
        with pytest.raises(ConfigurationError, match=rf"--rate 50, but {head} in m?s says 111"):
            read_recordings(path, rate=50)


@pytest.mark.parametrize("said", ["fps: 40", "robot: UR5e, sample rate = 40 Hz", "dt: 25 ms"])
def test_the_rate_in_a_comment_holds_for_a_column_of_frames(tmp_path, said):
    path = table(tmp_path, "frame,a", [np.arange(60), SWING], above=f"# {said}")
    assert read_recordings(path)[0].period == pytest.approx(0.025)
    assert read_recordings(path, rate=40)[0].period == pytest.approx(0.025)
    with pytest.raises(ConfigurationError, match=r"in the file says 40 frames .*drop"):
        read_recordings(path, rate=100)
    unread = read_recordings(path, rate=100, time_column="none")[0]
    assert unread.period == pytest.approx(0.01)
    skipping = np.delete(np.arange(61), 30)
    path = table(tmp_path, "frame,a", [skipping, SWING], above=f"# {said}")
    assert read_recordings(path)[0].duration == pytest.approx(1.5)


@pytest.mark.parametrize(("head", "number"), [("rate_hz", 40), ("fps", 40), ("dt_ms", 25)])
def test_a_column_of_one_number_that_is_a_rate_is_that_of_the_frames(tmp_path, head, number):
    path = table(tmp_path, f"a,{head}", [SWING, np.full(60, number)])
    assert read_recordings(path, joints=["a"])[0].period == pytest.approx(0.025)
    if head != "dt_ms":  # else it is summed, and held against the rate as times are
        with pytest.raises(ConfigurationError, match=f"{head} in the file says 40 .*drop --rate"):
            read_recordings(path, joints=["a"], rate=100)
    for other in ("freq", "Freq_Hz"):  # of the swing
        path = table(tmp_path, f"a,{other}", [SWING, np.full(60, 20)])
        assert read_recordings(path, joints=["a"], rate=100)[0].period == pytest.approx(0.01)


@pytest.mark.parametrize("name", ["frame", "frame_index", "step", "seq", "sample"])
def test_a_counter_of_frames_is_no_clock_whatever_its_steps(tmp_path, name):
    path = table(tmp_path, f"{name},a", [10 * np.arange(60), SWING])  # ms, at 100 a second?
    for options in ({"time_column": name}, {"rate": 100.0}):
        with pytest.raises(
            UnclearUnitsError,
            match=r"10 at a time.*ms; or.* --time-column none.*--time-unit frame --rate HZ",
        ):
            import_demonstrations(path, outcomes={"0": [1.0, 0.0]}, joints=["a"], **options)
    frames = read_recordings(path, joints=["a"], time_unit="frame", rate=100.0)[0]
    assert frames.period == pytest.approx(0.1)
    rows = read_recordings(path, joints=["a"], time_column="none", rate=100.0)[0]
    assert rows.period == pytest.approx(0.01)
    said = read_recordings(path, joints=["a"], time_column=name, time_unit="ms")[0]
    assert said.period == pytest.approx(0.01)


def test_a_rate_in_a_comment_says_nothing_against_times(tmp_path):
    path = table(tmp_path, "t,a", [JITTER, SWING], above="# control rate: 500\n# fps: 30")
    for how in ({}, {"rate": 111}):
        assert read_recordings(path, **how)[0].duration == pytest.approx(np.ptp(JITTER))


def test_the_take_whose_times_are_in_another_unit_is_named(tmp_path):
    for i in range(3):
        path = table(tmp_path, "time,a", [JITTER * (1000 if i == 1 else 1), SWING])
        path.rename(tmp_path / f"t{i}.csv")
    with pytest.raises(UnclearUnitsError, match=r"t1: time in s would be .*looks like ms") as asked:
        read_recordings(tmp_path)
    assert asked.value.options == "--leave-out t1"
    assert len(read_recordings(tmp_path, leave_out=["t1"])) == 2
    with pytest.raises(UnclearUnitsError, match=r"t0, t2: time in ms, as --time-unit") as asked:
        read_recordings(tmp_path, time_unit="ms")
    assert "--leave-out t1" in asked.value.options


def test_a_line_of_means_below_is_named_and_not_a_missing_time(tmp_path):
    t, q = sampled(0, 50)
    rows = [",".join(map(repr, r)) for r in np.c_[t, q].tolist()]
    text = "\n".join([",".join(("Zeit [s]", *JOINTS)), *rows, "Mittelwert,0,0,0,0,0,0,0"])
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(
        FileFormatError, match=rf"line {len(t) + 2}: Zeit .* is 'Mittelwert'.* take"
    ):
        read_recordings(tmp_path / "log.csv")


@pytest.mark.parametrize("name", ["frame", "Sample", "step_index"])
def test_a_counter_is_asked_for_its_rate_and_is_no_clock_in_ms(tmp_path, name):
    t, q = sampled(0, 500)
    rows = [",".join(map(repr, r)) for r in np.c_[np.arange(len(t)), q].tolist()]
    (tmp_path / "log.csv").write_text("\n".join([",".join((name, *JOINTS)), *rows]))
    with pytest.raises(UnclearUnitsError, match="counts frames") as asked:
        read_recordings(tmp_path / "log.csv")
    assert "--time-unit frame --rate HZ" in asked.value.options
    (read,) = read_recordings(tmp_path / "log.csv", time_column=name, time_unit="frame", rate=500)
    np.testing.assert_allclose(read.times, t)


@pytest.mark.parametrize("days", [("03.09.2024", "04.09.2024"), ("2024-03-09", "2024-03-10")])
def test_a_date_and_a_time_of_day_are_one_time_over_midnight(tmp_path, days):
    t, q = sampled(0, 50)
    lines = [",".join(("date", "time", *JOINTS))]
    for at, row in zip(t, q.tolist(), strict=True):
        late = at >= 1
        clock = f"00:00:{at - 1:06.3f}" if late else f"23:59:{59 + at:06.3f}"
        lines.append(",".join((days[int(late)], clock, *map(repr, row))))
    (tmp_path / "log.csv").write_text("\n".join(lines))
    (read,) = read_recordings(tmp_path / "log.csv")
    np.testing.assert_allclose(read.times, t, atol=1e-6)
    assert read.names == JOINTS


def test_dates_of_a_log_of_changes_are_the_times(tmp_path):
    stamps = ["09:00:20.000", "09:00:20.460", "09:00:20.490", "09:00:20.510", "09:00:20.900"]
    rows = [f"2024-05-21 {stamp};{k};{-k}" for k, stamp in enumerate(stamps)]
    (tmp_path / "a.csv").write_text("\n".join(["SourceTimestamp;pan;lift", *rows]))
    (read,) = read_recordings(tmp_path / "a.csv")
    np.testing.assert_allclose(read.times, [0, 0.46, 0.49, 0.51, 0.9])


def test_times_of_each_channel_that_differ_are_refused(tmp_path):
    late_by = {0: None, 0.001: None, 100: "two columns Time that differ, 0 and 100 first"}
    for (late, says), head in product(late_by.items(), ("Time", "Time.1")):
        rows = [f"{4 * k},{k},{4 * k + late},{-k}" for k in range(9)]
        (tmp_path / "a.csv").write_text("\n".join([f"Time,pan,{head},lift", *rows]))
        with pytest.raises(FileFormatError, match=says) if says else nullcontext():
            read_recordings(tmp_path / "a.csv", joints=["pan", "lift"], time_unit="ms")


def test_thousands_in_a_column_of_times_are_told_as_such(tmp_path):
    rows = [f"{t};{k},5" for k, t in enumerate(["980", "990", "1.000", "1.010", "1020"] * 2)]
    (tmp_path / "a.csv").write_text("\n".join(["Zeit [ms];pan", *rows]))
    with pytest.raises(FileFormatError, match=r"'1\.000', expected a time; if that is"):
        read_recordings(tmp_path / "a.csv")


@pytest.mark.parametrize(("name", "stamp"), [("Ticks", 80_000), ("time_to_release", -0.008)])
def test_ticks_are_the_times_and_what_counts_down_is_refused_beside_a_rate(tmp_path, name, stamp):
    t, q = sampled(0, 125)
    start = 639_000_000_000_000_000 if stamp > 0 else 2.0
    stamps = [start + i * stamp for i in range(len(t))]
    pd.DataFrame(q, columns=JOINTS).assign(**{name: stamps}).to_csv(tmp_path / "0.csv", index=False)
    if stamp > 0:
        (recording,) = read_recordings(tmp_path)
        np.testing.assert_allclose(recording.times, t, atol=2e-5)
        return
    with pytest.raises(InvalidDemonstrationsError, match="falls with every frame"):
        read_recordings(tmp_path, rate=100)
    assert read_recordings(tmp_path, rate=125, time_column="none")


@pytest.mark.parametrize("head", ["secs,nsecs", "seconds,nseconds", "sec,nanosec"])
def test_seconds_of_a_pair_number_no_episodes(tmp_path, head):
    times = 0.17 + np.arange(80) / 20
    rows = [
        f"{1603898605 + int(t)},{round(t % 1 * 1e9)},{np.sin(t):.4f},{np.cos(t):.4f}"
        for t in times.tolist()
    ]
    (tmp_path / "a.csv").write_text("\n".join([f"{head},j1,j2", *rows]))
    (recording,) = read_recordings(tmp_path / "a.csv")
    assert (recording.episode, recording.names) == ("a", ("j1", "j2"))
    np.testing.assert_allclose(recording.times, np.arange(80) / 20, atol=1e-6)


def test_dates_in_whole_seconds_number_no_episodes_and_repeat(tmp_path):
    rows = [f"2024-09-24 14:05:{i // 25 + 10},{1210441551 + 12 * i},{i % 7}" for i in range(100)]
    (tmp_path / "a.csv").write_text("\n".join(["Timestamp,IPOC,j1", *rows]))
    with pytest.raises(FileFormatError, match="--time-column IPOC"):
        read_recordings(tmp_path / "a.csv")
    (recording,) = read_recordings(tmp_path / "a.csv", time_column="IPOC", time_unit="ms")
    np.testing.assert_allclose(recording.times, np.arange(100) * 0.012)


def test_days_may_number_episodes(tmp_path):
    rows = [f"2024-09-{i // 25 + 10},{i % 25 / 50},{i % 7}" for i in range(100)]
    (tmp_path / "a.csv").write_text("\n".join(["session,t,j1", *rows]))
    assert len(read_recordings(tmp_path / "a.csv")) == 4


@pytest.mark.parametrize("said", [{}, {"time_column": "none", "rate": 50.0}])
@pytest.mark.parametrize("missing", [0, 1])
def test_rows_of_one_joint_each_are_to_be_pivoted_whatever_the_joints(tmp_path, said, missing):
    rows = [f"{k / 50},{name},{(k * i) % 5}" for k in range(9) for i, name in enumerate(JOINTS)]
    text = "\n".join(["time,name,position", *rows[: len(rows) - missing]])
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(FileFormatError, match=r"pivot\(index=TIME, columns='name'"):
        read_recordings(tmp_path / "a.csv", **said)
