"""Formats are told apart and episodes chosen; damage is `tests/attacks/`."""

import builtins
import shutil
import sys
from dataclasses import replace

import h5py
import numpy as np
import pytest

from prior_reinforce.arm.recordings import (
    Recording,
    appended,
    import_demonstrations,
    importer,
    read_recordings,
)
from prior_reinforce.arm.recordings.importer import Format, detect_format
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    MissingExtraError,
    UnclearUnitsError,
)
from tests.arm.recordings.recorded import (
    JOINTS,
    OUTCOMES,
    N,
    sampled,
    write_bag,
    write_bags,
    write_csv,
    write_lerobot,
    write_npz,
    write_outcomes,
    write_robomimic,
    write_zarr,
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "extra", "write"),
    [
        ("pyarrow", "lerobot", lambda folder: write_lerobot(folder / "set")),
        ("h5py", "hdf5", write_robomimic),
        ("zarr", "zarr", write_zarr),
        ("rosbags", "ros", lambda folder: write_bag(folder / "throw0", 0, kind="mcap")),
    ],
)
def test_a_missing_library_names_its_extra(tmp_path, monkeypatch, module, extra, write):
    source = write(tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=rf"pip install -e '\.\[{extra}\]'"):
        read_recordings(source)


@pytest.mark.slow
def test_the_core_formats_need_no_optional_library(tmp_path, monkeypatch):
    real = builtins.__import__

    def without(name, *arguments, **options):
        if name.split(".")[0] in ("pyarrow", "h5py", "rosbags", "zarr"):
            raise ModuleNotFoundError(f"No module named {name!r}")
        return real(name, *arguments, **options)

    write_outcomes(write_csv(tmp_path))
    monkeypatch.setattr(builtins, "__import__", without)
    assert import_demonstrations(tmp_path).demonstrations.n == N


def test_episodes_are_chosen_by_name_and_order(tmp_path):
    write_outcomes(write_csv(tmp_path))
    result = import_demonstrations(tmp_path, episodes=["4", "0", "1"])
    assert result.episodes == ("4", "0", "1")
    np.testing.assert_allclose(
        result.demonstrations.outcomes_seen, [OUTCOMES["4"], OUTCOMES["0"], OUTCOMES["1"]]
    )
    with pytest.raises(InvalidDemonstrationsError, match=r"no episode 9 in .*0, 1, 2, 3, 4, 5"):
        import_demonstrations(tmp_path, episodes=["9"])


@pytest.mark.parametrize("name", ["nothing.npz", "nothing", "text.txt"])
def test_no_recording(tmp_path, name):
    (tmp_path / "text.txt").write_text("hello")
    with pytest.raises(FileFormatError, match=r"no recording at|has 0 frames; expected"):
        read_recordings(tmp_path / name)


def test_a_folder_of_two_formats_asks_which(tmp_path):
    write_npz(write_csv(tmp_path))
    with pytest.raises(FileFormatError, match="npz and csv: say which with --format"):
        read_recordings(tmp_path)
    assert len(read_recordings(tmp_path, format="csv")) == N
    with pytest.raises(ConfigurationError, match="unknown format 'pickle'"):
        read_recordings(tmp_path, format="pickle")


def test_two_episodes_of_one_name(tmp_path):
    (tmp_path / "log.csv").write_text("episode,t,a\nthrow,0,1\nthrow,1,2\n")
    (tmp_path / "throw.csv").write_text("t,a\n0,1\n1,2\n")
    with pytest.raises(InvalidDemonstrationsError, match="more than one episode named throw"):
        read_recordings(tmp_path)


WRITERS = {
    "npz": lambda folder: write_npz(folder, rate=50),
    "csv": lambda folder: write_csv(folder, rate=50),
    "lerobot": lambda folder: write_lerobot(folder / "set", rate=50),
    "hdf5": write_robomimic,
    "zarr": write_zarr,
    "ros1": lambda folder: write_bags(folder, kind="ros1", rate=20, count=2),
    "sqlite": lambda folder: write_bags(folder, kind="sqlite", rate=20, count=2),
    "mcap": lambda folder: write_bags(folder, kind="mcap", rate=20, count=2),
}


FEWER = dict.fromkeys(("ros1", "sqlite", "mcap"), 2)


OPTIONS = {"zarr": {"key": "joint_pos", "rate": 50}}


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    """One good recording of each format, with its outcomes."""
    folders = {}
    for name, write in WRITERS.items():
        folder = tmp_path_factory.mktemp(name) / "recording"
        folder.mkdir()
        write(folder)
        few = {key: OUTCOMES[key] for key in list(OUTCOMES)[: FEWER.get(name, N)]}
        write_outcomes(folder, few)
        folders[name] = folder
    return folders


def source_of(folder, name):
    return {
        "lerobot": folder / "set",
        "hdf5": folder / "demos.hdf5",
        "zarr": folder / "replay_buffer.zarr",
    }.get(name, folder)


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
def test_the_originals_are_good(originals, name):
    result = import_demonstrations(
        source_of(originals[name], name), joints=JOINTS, **OPTIONS.get(name, {})
    )
    assert result.demonstrations.n == FEWER.get(name, N)


@pytest.mark.parametrize("rate", [0.0, -5.0, float("nan")])
def test_the_rate_is_checked(originals, rate):
    with pytest.raises(ConfigurationError, match="positive number of frames a second"):
        read_recordings(originals["npz"], rate=rate)


@pytest.mark.slow
def test_an_option_that_has_no_use_is_refused(originals):
    with pytest.raises(ConfigurationError, match="--delimiter tab has no use for npz; drop it"):
        read_recordings(originals["npz"], delimiter="tab")
    with pytest.raises(
        ConfigurationError, match="--time-column t is no clock of a bag; give header or rec"
    ):
        read_recordings(originals["ros1"], time_column="t")
    with pytest.raises(ConfigurationError, match="delimiter must be one of comma, semicolon"):
        read_recordings(originals["csv"], delimiter="dash")
    with pytest.raises(ConfigurationError, match="--time-unit ms is of a column of times"):
        read_recordings(originals["hdf5"] / "demos.hdf5", time_unit="ms")
    with pytest.raises(ConfigurationError, match="time-unit must be one of s, ms"):
        read_recordings(originals["csv"], time_unit="minutes")
    for name, says in {
        "npz": "t in s says 50 Hz",
        "csv": "t in s says 50 Hz",
        "mcap": "header stamps in ns says 20 Hz",
    }.items():
        with pytest.raises(ConfigurationError, match=f"--rate 1000, but .*{says}; drop --rate"):
            read_recordings(originals[name], rate=1000)


@pytest.mark.slow
def test_milliseconds_that_nobody_names_are_refused_until_said(tmp_path):
    for i in range(N):
        t, q = sampled(i, 100)
        table = np.column_stack([1000 * t, q])
        header = ",".join(["t", *JOINTS])
        np.savetxt(tmp_path / f"{i}.csv", table, delimiter=",", header=header, comments="")
    write_outcomes(tmp_path)
    with pytest.raises(UnclearUnitsError, match=r"in ms 100 Hz .* add: --time-unit ms$"):
        read_recordings(tmp_path)
    with pytest.raises(ConfigurationError, match="drop --rate, say the unit with --time-unit"):
        read_recordings(tmp_path, rate=50)
    for said in ({"time_unit": "ms"}, {"take_guesses": True}):
        assert read_recordings(tmp_path, **said)[0].times[-1] == pytest.approx(1.7)


def test_all_that_is_unclear_is_said_at_once(tmp_path):
    """Milliseconds, degrees and missing outcomes: one message, not three."""
    for i in range(N):
        t, q = sampled(i, 100)
        np.savez(tmp_path / f"{i}.npz", t=1000 * t, q=np.rad2deg(q))
    with pytest.raises(UnclearUnitsError) as caught:
        import_demonstrations(tmp_path)
    assert "add: --time-unit ms --units deg; and no outcomes for episodes" in str(caught.value)
    with pytest.raises(InvalidDemonstrationsError, match=r"^no outcomes for episodes"):
        import_demonstrations(tmp_path, take_guesses=True)


@pytest.mark.slow
def test_episodes_are_left_out_by_name(originals):
    names = [r.episode for r in read_recordings(originals["csv"], leave_out=["1", "4"])]
    assert names == ["0", "2", "3", "5"]
    result = import_demonstrations(originals["csv"], leave_out=["1"])
    assert result.demonstrations.n == N - 1
    with pytest.raises(InvalidDemonstrationsError, match=r"no episode 9 .* it has 0, 1, 2"):
        read_recordings(originals["csv"], leave_out=["9"])
    with pytest.raises(InvalidDemonstrationsError, match="no episode is left"):
        read_recordings(originals["csv"], episodes=["1"], leave_out=["1"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["npz", "csv", "hdf5"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_not_finite_is_a_lost_frame_named_with_its_episode(
    originals, tmp_path, name, value
):
    folder = tmp_path / "recording"
    shutil.copytree(originals[name], folder)
    if name == "npz":
        with np.load(folder / "throw_2.npz") as archive:
            content = {key: np.array(archive[key]) for key in archive.files}
        content["q"][7, 3] = value
        np.savez(folder / "throw_2.npz", **content)
    elif name == "csv":
        lines = (folder / "2.csv").read_text().splitlines()
        cells = lines[8].split(",")
        lines[8] = ",".join([*cells[:4], str(value), *cells[5:]])
        (folder / "2.csv").write_text("\n".join(lines))
    else:
        with h5py.File(folder / "demos.hdf5", "a") as file:
            file["data/demo_2/obs/robot0_joint_pos"][7, 3] = value
    remarks = import_demonstrations(source_of(folder, name)).preview.remarks
    joint = "column4" if name == "hdf5" else "joint4"
    said = f"2: {joint} is {value} at frame 7; 1 frame is left out, as lost packets are"
    assert any(remark.endswith(said) for remark in remarks)


def test_a_data_set_is_recognised_whatever_else_lies_in_its_folder(tmp_path):
    folder = write_lerobot(tmp_path / "set")
    write_npz(folder)
    assert detect_format(folder) == "lerobot"
    assert detect_format(write_csv(tmp_path)) == "csv"


def test_a_format_is_one_entry_of_the_table(tmp_path, monkeypatch):
    def read(source, options):
        t, q = sampled(int(options.key[0]), 100)
        yield source.stem, lambda: Recording(source.stem, t, q, JOINTS)

    mine = Format(read, lambda source: source.suffix == ".mine")
    monkeypatch.setattr(importer, "FORMATS", {**importer.FORMATS, "mine": mine})
    (tmp_path / "throw.mine").touch()
    (recording,) = read_recordings(tmp_path / "throw.mine", key="2")
    np.testing.assert_array_equal(recording.positions, sampled(2, 100)[1])
    (tmp_path / "throw.yours").touch()
    with pytest.raises(FileFormatError, match=r"what is read is npz, .*, mine"):
        read_recordings(tmp_path / "throw.yours")


@pytest.mark.slow
def test_only_demonstrations_of_one_kind_are_joined(originals):
    fifty = import_demonstrations(originals["npz"]).demonstrations
    twenty = import_demonstrations(originals["hdf5"] / "demos.hdf5").demonstrations
    with pytest.raises(
        InvalidDemonstrationsError, match=r"plans of .*dt=0.02.*import all together"
    ):
        appended(fifty, twenty, "abcdef")


def test_what_is_known_of_outcomes_is_joined_too(originals):
    kept = import_demonstrations(originals["npz"]).demonstrations
    known = {"outcome_noise": 0.02, "outcome_correction": -0.01}
    parts = [
        replace(kept.only(chosen), **{name: np.full((2, 2), of) for name, of in known.items()})
        for chosen in ((0, 1), (2, 3))
    ]
    joined = appended(*parts, "ab")
    for name, of in known.items():
        np.testing.assert_array_equal(getattr(joined, name), np.full((4, 2), of))


@pytest.mark.slow
def test_a_motion_that_comes_twice_is_refused(originals, tmp_path):
    folder = tmp_path / "recordings"
    shutil.copytree(originals["npz"], folder)
    shutil.copy(folder / "throw_1.npz", folder / "throw_6.npz")
    write_outcomes(folder, OUTCOMES | {"6": (1.2, 0.3)})
    said = "throw_1 and throw_6 are one motion to the last number"
    with pytest.raises(InvalidDemonstrationsError, match=said):
        import_demonstrations(folder)
    kept = import_demonstrations(folder, leave_out=["throw_6"]).demonstrations
    other = replace(kept, outcomes_seen=kept.outcomes_seen + 0.01)
    said = "demonstration 0 so far and a are one motion"
    with pytest.raises(InvalidDemonstrationsError, match=said):
        appended(kept, other, "abcdef")


def _day(tmp_path, parts, gap=0.0):
    """One file of joint positions at 100 Hz, and six outcomes that are numbered."""
    now, rows = 0.0, ["time,q1,q2"]
    for begin, end in parts:
        s = np.clip((np.arange(180) / 100 - 0.4) / 1.0, 0, 1)
        for k, x in enumerate(10 * s**3 - 15 * s**4 + 6 * s**5):
            q = np.array(begin) + x * (np.array(end) - begin)
            rows.append(f"{now + k / 100:.3f},{q[0]:.5f},{q[1]:.5f}")
        now += 1.8 + gap
    (tmp_path / "log.csv").write_text("\n".join(rows))
    outcomes = [f"{i},{0.8 + 0.05 * i:.2f},{0.1 * (-1) ** i:.1f}" for i in range(6)]
    (tmp_path / "outcomes.csv").write_text("\n".join(["episode,x,y", *outcomes]))
    return tmp_path / "log.csv"


ENDS = [(0.6 + 0.05 * i, -0.4 + 0.03 * (i % 3)) for i in range(6)]


def test_ways_back_between_throws_are_named_and_outcomes_are_taken_as_they_come(tmp_path):
    start = (0.1, 0.2)
    parts = [pair for end in ENDS for pair in ((start, end), (end, start))]
    path, back = _day(tmp_path, parts), [f"log-{i}" for i in range(1, 12, 2)]
    with pytest.raises(InvalidDemonstrationsError, match=f"--leave-out {' '.join(back)}"):
        import_demonstrations(path, rests=0.5)
    taken = import_demonstrations(path, rests=0.5, leave_out=back).demonstrations
    np.testing.assert_allclose(taken.plans[:, -1], ENDS, atol=1e-3)
    np.testing.assert_allclose(taken.outcomes_seen[:, 0], 0.8 + 0.05 * np.arange(6))
    given = {str(i): (0.8 + 0.05 * i, 0.1 * (-1) ** i) for i in reversed(range(6))}
    told = import_demonstrations(path, rests=0.5, leave_out=back, outcomes=given).demonstrations
    np.testing.assert_allclose(told.outcomes_seen, taken.outcomes_seen)


def test_an_approach_in_every_file_is_cut_off_as_the_remark_says(tmp_path):
    for i, end in enumerate(ENDS):
        path = _day(tmp_path, [((0.4, 0.5), (0.1, 0.2)), ((0.1, 0.2), end)])
        path.rename(tmp_path / f"{i}.csv")
    approaches = tuple(f"{i}-0" for i in range(6))
    (remark,) = import_demonstrations(tmp_path).preview.remarks
    assert f"--rests 0.5 --leave-out {' '.join(approaches)} (" in remark
    cut = import_demonstrations(tmp_path, rests=0.5, leave_out=approaches)
    np.testing.assert_allclose(cut.demonstrations.plans[:, 0], [(0.1, 0.2)] * 6, atol=1e-3)
    assert not cut.preview.remarks
    assert not import_demonstrations(tmp_path, rests=0).preview.remarks


def test_a_recorder_that_pauses_with_the_arm_is_cut_where_it_pauses(tmp_path):
    path = _day(tmp_path, [((0.1, 0.2), end) for end in ENDS], gap=8.0)
    text = "\n".join(  # without the rests before and after
        line
        for i, line in enumerate(path.read_text().splitlines())
        if i == 0 or 30 <= (i - 1) % 180 < 150
    )
    path.write_text(text)
    taken = import_demonstrations(path, rests=0.5).demonstrations
    np.testing.assert_allclose(taken.plans[:, -1], ENDS, atol=1e-3)
    np.testing.assert_allclose(taken.plans[:, 0], [(0.1, 0.2)] * 6, atol=1e-3)
