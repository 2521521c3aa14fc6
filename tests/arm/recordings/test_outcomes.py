"""Outcomes beside a recording: matched, converted, and every one that is missing is named."""

import shlex
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from prior_reinforce.arm.recordings import import_demonstrations, read_recordings
from prior_reinforce.arm.recordings.outcomes import (
    Outcomes,
    check_rows,
    keep_places,
    missing_outcomes,
    outcomes_of,
    places_of,
    read_outcomes,
    write_outcome_table,
)
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.takes import ways_back
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    UnclearUnitsError,
)
from prior_reinforce.formats import OutcomeFormat
from tests.arm.recordings.recorded import (
    OUTCOMES,
    rows_of_outcomes,
    table,
    write_csv,
    write_outcomes,
)


def test_without_outcomes_every_episode_is_named(recording):
    with pytest.raises(InvalidDemonstrationsError, match=r"episodes 0, 1, 2, 3, 4, 5.*outcomes.cs"):
        import_demonstrations(recording)


def test_those_that_are_missing_are_named(recording, tmp_path):
    path = table(tmp_path, "episode,x,y\n0,0.8,0.1\n1,0.9,0.2\n3,0.9,-0.1\n4,,\n5,1,0\n")
    with pytest.raises(InvalidDemonstrationsError, match="no outcome for episodes 2, 4 in"):
        import_demonstrations(recording, outcomes=path)


def test_those_of_no_episode_are_named(recording, tmp_path):
    path = write_outcomes(tmp_path, OUTCOMES | {"17": (1.0, 1.0)})
    with pytest.raises(InvalidDemonstrationsError, match="names episodes 17 that were not found"):
        import_demonstrations(recording, outcomes=path)


def test_where_there_is_no_table_it_is_said_what_writes_one(recording):
    with pytest.raises(
        InvalidDemonstrationsError, match=r"outcomes.csv with .* \(import --inspect writes one"
    ):
        import_demonstrations(recording)


def test_given_numbers(recording):
    result = import_demonstrations(recording, outcomes=OUTCOMES)
    np.testing.assert_array_equal(result.demonstrations.outcomes_seen, list(OUTCOMES.values()))
    with pytest.raises(ConfigurationError, match="must be numbers"):
        import_demonstrations(recording, outcomes={"0": ["far", 1]})
    with pytest.raises(InvalidDemonstrationsError, match="finite numbers"):
        import_demonstrations(recording, outcomes=OUTCOMES | {"2": (float("nan"), 0.0)})
    with pytest.raises(InvalidDemonstrationsError, match="components"):
        import_demonstrations(recording, outcomes=OUTCOMES | {"2": (1.0,)})


def test_centimetres_in_a_columns_name_are_converted(tmp_path):
    path = table(tmp_path, "episode,x_cm,y [mm],z_m,t,source,comment\n0,92,-50,0.3,1.5,tape,ok\n")
    outcomes = read_outcomes(path)
    assert outcomes.names == ("x", "y", "z", "t")
    np.testing.assert_allclose(outcomes.values, [(0.92, -0.05, 0.3, 1.5)])
    assert (outcomes.episodes, *outcomes.sd) == (("0",), 0.0)
    assert outcomes.units == ("m", "m", "m", None)


def test_a_column_of_words_is_a_note_and_no_outcome(tmp_path):
    text = "Wurf;vorne (cm);links (cm);Bemerkung\nWurf 1;79,4;-2,5;gut\nWurf 2;81,9;5,2;zu kurz\n"
    found = read_outcomes(table(tmp_path, text), ("x", "y"))
    assert found.names == ("vorne", "links")
    with pytest.raises(
        InvalidDemonstrationsError, match=r"no column x, y; it has vorne, links: re"
    ):
        found.only(("x", "y"))


def test_columns_in_another_order_are_matched_by_name(recording, tmp_path):
    lines = ["y,episode,x"] + [f"{y},{name},{x}" for name, (x, y) in OUTCOMES.items()]
    path = table(tmp_path, "\n".join(lines))
    named = import_demonstrations(recording, outcomes=path, outcome_names=("x", "y"))
    np.testing.assert_allclose(named.demonstrations.outcomes_seen, list(OUTCOMES.values()))
    as_written = import_demonstrations(recording, outcomes=path).demonstrations
    assert as_written.outcome_format.names == ("y", "x")
    one = import_demonstrations(recording, outcomes=path, outcome_names=("x",)).demonstrations
    np.testing.assert_allclose(one.outcomes_seen[:, 0], [x for x, _ in OUTCOMES.values()])
    with pytest.raises(InvalidDemonstrationsError, match="no column z; it has y, x"):
        import_demonstrations(recording, outcomes=path, outcome_names=("x", "z"))


def test_episodes_are_matched_by_their_number(recording, tmp_path):
    named = {f"demo_{int(name):04d}": values for name, values in OUTCOMES.items()}
    result = import_demonstrations(recording, outcomes=write_outcomes(tmp_path, named))
    np.testing.assert_allclose(result.demonstrations.outcomes_seen, list(OUTCOMES.values()))


def test_numbers_that_two_names_share_match_nothing(recording, tmp_path):
    named = {f"a{name}": values for name, values in OUTCOMES.items()} | {"b3": (2.0, 2.0)}
    with pytest.raises(InvalidDemonstrationsError, match="no outcome for episodes 3 in"):
        import_demonstrations(recording, outcomes=write_outcomes(tmp_path, named))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "expected column names"),
        ("a,b\n1,2\n", "expected column names"),
        ("episode\n1\n", "expected column names"),
        ("episode,x,x\n1,2,3\n", "expected column names"),
        ("order,x,y\n1,2,3\n", "none of these names the recordings; .* episode"),
        ("episode,x_cm,y_cm,x_m\n1,2,3,4\n", ": x_cm and x_m are all x; keep one"),
        ("episode,x,y\n1,2\n", "line 2: y is '', expected a finite number"),
        ("episode,x,y\n1,2,3\n1,2,4\n", "line 3: episode 1 again"),
        ("episode,x,y\n1,5cm,3\n", "line 2: x is '5cm', expected a finite number"),
        ("episode,x,y\n1,inf,3\n", "line 2: x is 'inf', expected a finite number"),
        ("episode,x,y\n1,2,\n", "line 2: y is '', expected a finite number"),
    ],
)
def test_tables_that_cannot_be_read(tmp_path, text, says):
    with pytest.raises(FileFormatError, match=says):
        read_outcomes(table(tmp_path, text))


def test_a_table_in_another_encoding(tmp_path):
    path = tmp_path / "outcomes.csv"
    path.write_bytes(b"episode,x\n\xff\xfe,1\n")
    with pytest.raises(FileFormatError, match="CSV in UTF-8"):
        read_outcomes(path)
    with pytest.raises(FileFormatError, match="no table at"):
        read_outcomes(tmp_path / "missing.csv")


def test_only_a_table_that_stands_beside_the_recordings_is_taken(tmp_path):
    folder = tmp_path / "today"
    folder.mkdir()
    write_outcomes(write_csv(folder).parent)  # in the folder above
    with pytest.raises(InvalidDemonstrationsError) as caught:
        import_demonstrations(folder)
    assert f"write {folder}/outcomes.csv" in str(caught.value)
    assert f"({tmp_path}/outcomes.csv is not beside them: name it with --outcomes" in str(
        caught.value
    )
    named = import_demonstrations(folder, outcomes=tmp_path / "outcomes.csv")
    assert f"from {tmp_path}/outcomes.csv" in named.preview.text


@pytest.mark.parametrize("column", ["episode", "file"])
def test_a_table_among_the_recordings_is_no_recording(tmp_path, column):
    for i in range(2):
        rows = [f"{k / 10},{np.sin(k / 4 + i)}" for k in range(20)]
        (tmp_path / f"throw_{i}.csv").write_text("\n".join(["t,joint1", *rows]))
    path = tmp_path / "results.csv"
    path.write_text(f"{column},x,y\nthrow_0,0.8,0.1\nthrow_1,0.9,-0.1\n")
    with pytest.raises(UnclearUnitsError, match=r"results\.csv has a row for each") as caught:
        import_demonstrations(tmp_path)
    assert caught.value.options == f"--outcomes {path}"
    result = import_demonstrations(tmp_path, outcomes=path)
    assert result.episodes == ("throw_0", "throw_1")
    path.rename(tmp_path / "Outcomes.CSV")
    assert import_demonstrations(tmp_path).episodes == result.episodes


def test_a_table_to_fill_in_has_the_episodes_names_and_the_units(tmp_path):
    path = tmp_path / "outcomes.csv"
    write_outcome_table(path, {"throw_1": (), "a,b": ()}, ["x", "turns"], ["m", "counts"])
    assert path.read_text() == 'episode,x [m],turns,note\nthrow_1,,,\n"a,b",,,\n'
    assert read_outcomes(path).episodes == ()
    path.write_text(path.read_text().replace("[m]", "[cm]").replace("1,,", "1,92,3"))
    assert read_outcomes(path).episodes == ("throw_1",)
    np.testing.assert_allclose(read_outcomes(path).values, [(0.92, 3.0)])
    assert missing_outcomes(["throw_1", "a,b"], read_outcomes(path)) == ["a,b"]


@pytest.mark.parametrize(
    ("head", "unit", "noise"),
    [
        ("episode,x,y,sd", None, 0.02),
        ("episode,x [m],y [m],sd_cm", None, 0.0002),
        ("episode,x,y,sd [m]", "cm", 0.02),
        ("episode,x,y,SD", "cm", 0.0002),
    ],
)
def test_a_table_may_say_how_uncertain_outcomes_are(recording, tmp_path, head, unit, noise):
    scale = 100 if unit else 1
    rows = [f"{name},{scale * x},{scale * y},0.02" for name, (x, y) in OUTCOMES.items()]
    rows[1:3] = [rows[1].removesuffix("0.02"), rows[2].removesuffix("0.02") + "0"]
    path = table(tmp_path, "\n".join([head, *rows]))
    result = import_demonstrations(recording, outcomes=path, outcome_unit=unit)
    expected = np.full((len(OUTCOMES), 2), noise)
    expected[1:3] = 0.0
    np.testing.assert_allclose(result.demonstrations.outcome_noise, expected)
    np.testing.assert_allclose(result.demonstrations.outcomes_seen, list(OUTCOMES.values()))
    assert f"uncertain by up to {1000 * noise:.2g} mm" in result.preview.text


def test_the_uncertainty_may_be_the_first_column(tmp_path):
    found = read_outcomes(table(tmp_path, "sd,episode,x,y\n0.02,a,1,2\n,b,3,4\n"))
    assert found.episodes == ("a", "b")
    np.testing.assert_allclose(found.values, [(1, 2), (3, 4)])
    np.testing.assert_allclose(found.sd, (0.02, 0))


@pytest.mark.parametrize(
    "unit", ["m", "meters", "degrees", "deg", "°", "s", "seconds", "counts", ""]
)
def test_a_table_that_is_written_to_be_filled_in_is_read_in_the_units_of_the_task(
    recording, tmp_path, unit
):
    path = tmp_path / "outcomes.csv"
    write_outcome_table(path, dict.fromkeys(OUTCOMES, ()), ["x", "y"], [unit, unit])
    head, *_ = path.read_text().splitlines()
    rows = [f"{name},{x},{y}," for name, (x, y) in OUTCOMES.items()]
    path.write_text("\n".join([head, *rows]))
    result = import_demonstrations(recording, outcomes=path, outcome_units=(unit, unit))
    assert result.demonstrations.outcome_format.units == (unit, unit)
    np.testing.assert_allclose(result.demonstrations.outcomes_seen, list(OUTCOMES.values()))


def test_an_episode_called_like_a_formula_is_no_formula_in_the_table(tmp_path):
    path = tmp_path / "outcomes.csv"
    name = "=cmd|' -C calc'!A0"
    write_outcome_table(path, {name: (0.9, 0.1)}, ["x", "y"], ["m", "m"])
    assert path.read_text().splitlines()[1].startswith("'=cmd")
    assert read_outcomes(path).episodes == (name,)


@pytest.mark.parametrize(
    ("rows", "doubted"),
    [
        ("1,1.488,-302\n2,902,150\n", True),
        ("1,1.488,-302\n2,902.5,150\n", False),  # so the sign is a decimal one
        ("1,1.4880,-302\n2,902,150\n", False),
        ("1,1.488,-0.302\n2,1.402,0.150\n", False),
        ("1,1.488,2\n2,1.402,1\n", False),
    ],
)
def test_a_thousand_that_may_be_one_and_a_half_is_doubted(tmp_path, rows, doubted):
    path = tmp_path / "outcomes.csv"
    path.write_text(f"episode,x [mm],y [mm]\n{rows}")
    if not doubted:
        assert read_outcomes(path).values.shape == (2, 2)
        return
    with pytest.raises(FileFormatError, match=r"line 2: x \[mm\] is '1.488' beside 902.*1.4880"):
        read_outcomes(path)


@pytest.mark.parametrize(
    ("head", "rows", "doubted"),
    [
        ("x [mm];y [mm]", "1;1.012;90\n2;1.234;-83\n", True),
        ("x [ml];y", "1;1.012;9\n2;1.234;8\n", True),
        ("x [mm];y [mm]", "1;1.012;90.5\n2;1.234;-83\n", False),
        ("x [mm];y [mm]", "1;1,012;90\n2;1,234;-83\n", False),
        ("x [m];y [m]", "1;1.012;1.090\n2;1.234;1.083\n", False),
        ("x;y", "1;1.012;2\n2;1.234;1\n", False),
    ],
)
def test_a_point_before_three_digits_between_semicolons_is_doubted(tmp_path, head, rows, doubted):
    path = table(tmp_path, f"episode;{head}\n{rows}")
    if not doubted:
        assert abs(read_outcomes(path).values).max() < 100
        return
    with pytest.raises(FileFormatError, match=r"line 2: x \[m[ml]\] is '1.012' beside semicolons"):
        read_outcomes(path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("episode,x,y\n0,80.0 cm,10 cm\n", r"write 80.0, and the unit in the head: x \[cm\]"),
        ("episode,x [m],y\n0,80.0 cm,10 cm\n", "write numbers in m, without units"),
        (
            "episode,x,y,sd_x,sd_y\n0,0.8,0.1,0.01,0.02\n",
            "uncertainties in sd_x, sd_y, .*column sd",
        ),
    ],
)
def test_what_is_written_otherwise_is_told_with_what_to_write(recording, tmp_path, text, says):
    with pytest.raises(FileFormatError, match=says):
        read_outcomes(table(tmp_path, text), ["x", "y"])


@pytest.mark.parametrize("options", [{}, {"leave_out": ["0"]}])
def test_rows_that_are_numbered_otherwise_are_not_taken_for_their_neighbours(
    recording, tmp_path, options
):
    path = table(tmp_path, "\n".join(["episode,x,y", *rows_of_outcomes(first=1)]))
    with pytest.raises(InvalidDemonstrationsError, match=r"begins with 1, and they with 0: renumb"):
        import_demonstrations(recording, outcomes=path, **options)
    path = table(tmp_path, "\n".join(["episode,x,y", *rows_of_outcomes(first=1)[:5]]))
    with pytest.raises(InvalidDemonstrationsError, match=r"begins with 1, and they with 0: renumb"):
        import_demonstrations(recording, outcomes=path)


@pytest.mark.parametrize("there", [["0", "2", "3", "5"], [f"log_10-1{i}-0{i}" for i in range(4)]])
def test_a_table_that_counts_the_recordings_is_to_name_them(tmp_path, there):
    found = read_outcomes(table(tmp_path, "episode,x,y\n0,1,0\n1,1,0\n2,1,0\n3,1,0\n"))
    says = rf"\); the table seems to count the 4 recordings .* \(3 is {there[-1]}\); else correct"
    with pytest.raises(InvalidDemonstrationsError, match=says):
        check_rows(found, there, there)


def test_some_episodes_may_be_asked_for_with_a_table_of_more(recording, tmp_path):
    path = table(tmp_path, "\n".join(["episode,x,y", *rows_of_outcomes(), "17,1,0"]))
    assert import_demonstrations(recording, outcomes=path, episodes=["0", "3"]).episodes == (
        "0",
        "3",
    )


@pytest.mark.parametrize(
    ("head", "signs"),
    [("ahead,left", (1, 1)), ("ahead,right", (1, -1)), ("right,x", (-1, 1)), ("x,y", (1, 1))],
)
def test_columns_may_be_called_by_where_they_count_up_to(recording, tmp_path, head, signs):
    of = {"right": 1, "left": 1, "y": 1, "ahead": 0, "x": 0}
    places = [
        (episode, [OUTCOMES[episode][of[n]] for n in head.split(",")]) for episode in OUTCOMES
    ]
    said = [f"{e},{a * signs[0]},{b * signs[1]}" for e, (a, b) in places]
    path = table(tmp_path, "\n".join([f"episode,{head}", *said]))
    result = import_demonstrations(recording, outcomes=path, outcome_names=("x", "y"))
    np.testing.assert_allclose(result.demonstrations.outcomes_seen, list(OUTCOMES.values()))
    assert ("right is -y" in result.preview.text) == ("right" in head)


def test_a_printed_minus_is_read(recording, tmp_path):
    text = "\n".join(["episode,x,y", *rows_of_outcomes()])
    seen = import_demonstrations(recording, outcomes=table(tmp_path, text.replace("-", "\u2212")))
    np.testing.assert_allclose(seen.demonstrations.outcomes_seen, list(OUTCOMES.values()))


def test_a_cell_with_a_word_is_to_be_written_as_a_number(recording, tmp_path):
    path = table(tmp_path, "\n".join(["episode,x,y", *rows_of_outcomes()[:-1], "5,1.05,0.05 left"]))
    with pytest.raises(FileFormatError, match=r"'0.05 left'.* plain number"):
        import_demonstrations(recording, outcomes=path)


def test_ways_home_beside_the_throws_are_left_out_by_name(tmp_path):
    """`throw_3` and `home_3` share a number: the row 3 is of the one that is not left out."""
    folder = write_csv(tmp_path)
    for i in range(6):
        text = (folder / f"{i}.csv").read_text().splitlines()
        (folder / f"{i}.csv").unlink()
        (folder / f"throw_{i}.csv").write_text("\n".join(text))
        times, rows = zip(*(line.split(",", 1) for line in text[1:]), strict=True)
        back = [text[0], *(f"{t},{row}" for t, row in zip(times, rows[::-1], strict=True))]
        (folder / f"home_{i}.csv").write_text("\n".join(back))
    path = table(tmp_path, "\n".join(["episode,x,y", *rows_of_outcomes()]))
    homes = [f"home_{i}" for i in range(6)]
    seen = import_demonstrations(folder, outcomes=path, leave_out=homes).demonstrations
    np.testing.assert_allclose(seen.outcomes_seen, list(OUTCOMES.values()))


def test_a_distance_and_a_bearing_are_said_to_be_no_x_and_y(recording, tmp_path):
    path = table(tmp_path, "episode,r,angle\n0,0.9,7\n")
    with pytest.raises(InvalidDemonstrationsError, match="x = r cos b"):
        import_demonstrations(recording, outcomes=path, outcome_names=("x", "y"))


@pytest.mark.parametrize(
    ("names", "says"),
    [
        ("error_x_cm,error_y_cm", "error_x, error_y may be measured from a target, .* as x, y "),
        ("dx,dy", "dx, dy may be measured from a target, and outcomes are places"),
        ("X_cm,Z_cm", "Z is no y; add it, and turn what a camera saw in its own axes"),
        ("length,width", "rename or add it"),
    ],
)
def test_what_is_no_place_is_not_to_be_renamed(tmp_path, names, says):
    found = read_outcomes(table(tmp_path, f"take,{names}\n0,0.9,7\n"), ["x", "y"])
    assert found.word == "take"
    with pytest.raises(InvalidDemonstrationsError, match=says):
        found.only(["x", "y"])


def test_left_and_right_at_once_are_refused(recording, tmp_path):
    path = table(tmp_path, "episode,ahead,left,right\n0,0.9,0,0.12\n")
    with pytest.raises(InvalidDemonstrationsError, match="left and right for y"):
        import_demonstrations(recording, outcomes=path, outcome_names=("x", "y"))


def test_columns_in_capitals_are_the_components(recording, tmp_path):
    path = table(tmp_path, "\n".join(["Episode,X,Y", *rows_of_outcomes()]))
    result = import_demonstrations(recording, outcomes=path, outcome_names=("x", "y"))
    np.testing.assert_allclose(result.demonstrations.outcomes_seen, list(OUTCOMES.values()))


def test_a_letter_that_says_a_side_is_no_typo(recording, tmp_path):
    path = table(tmp_path, "\n".join(["episode,x,y", *rows_of_outcomes()[:-1], "5,1.05,0.05 L"]))
    with pytest.raises(FileFormatError, match="left is positive, right negative"):
        import_demonstrations(recording, outcomes=path)


def test_asking_for_some_episodes_does_not_hide_another_numbering(recording, tmp_path):
    path = table(tmp_path, "\n".join(["episode,x,y", *rows_of_outcomes(first=1)]))
    with pytest.raises(InvalidDemonstrationsError, match="renumber"):
        import_demonstrations(recording, outcomes=path, episodes=["1", "2", "3"])


def test_a_table_with_a_column_for_each_episode_is_to_be_turned(tmp_path):
    path = table(tmp_path, "episode,throw_0,throw_1\nx [m],0.8,0.9\ny [m],0.1,-0.1\n")
    with pytest.raises(InvalidDemonstrationsError, match="exchange rows and columns"):
        check_rows(read_outcomes(path), ("throw_0", "throw_1"), ("throw_0", "throw_1"))


@pytest.mark.parametrize("head", ["X,Y", "ahead,left", "x,y"])
def test_other_columns_may_hold_anything(recording, tmp_path, head):
    rows = [f"{row},good" for row in rows_of_outcomes()]
    path = table(tmp_path, "\n".join([f"episode,{head},surface", *rows]))
    result = import_demonstrations(recording, outcomes=path, outcome_names=("x", "y"))
    np.testing.assert_allclose(result.demonstrations.outcomes_seen, list(OUTCOMES.values()))


def test_places_that_are_kept_are_read_again(tmp_path):
    places = {"throw_1": (0.1, -0.2, 0.005), "throw_2": (1 / 3, 0.0, 0.0)}
    keep_places(tmp_path / "t.csv", places, OutcomeFormat.metres(2), tmp_path)
    read = read_outcomes(tmp_path / "t.csv")
    assert places_of(["throw_2", "take", "1"], read) == {
        "throw_2": places["throw_2"],
        "1": places["throw_1"],
    }
    assert read.sources == (str(tmp_path.resolve()),) * 2


def test_two_episodes_of_one_number_have_no_place_by_it(tmp_path):
    keep_places(tmp_path / "t.csv", {"1": (0.1, 0.2, 0.0)}, OutcomeFormat.metres(2))
    assert places_of(["a_1", "b_1"], read_outcomes(tmp_path / "t.csv")) == {}


def test_rows_may_be_called_by_the_files_of_the_recordings(tmp_path):
    (tmp_path / "o.csv").write_text(
        "episode,x,y\nrec/throw_1.csv,1,2\nThrow_b.MP4,3,4\nc.csvx,5,6\n"
    )
    rows = read_outcomes(tmp_path / "o.csv")
    assert rows.episodes == ("throw_1", "Throw_b", "c.csvx")
    assert missing_outcomes(["demo_001", "Throw_b", "demo_4"], rows) == ["demo_4"]


def paired(there, rows, column="episode", chosen=None):
    """Row of each episode, of a table of rows by that column."""
    names, places = chosen or there, [[float(i)] for i in range(len(rows))]
    found = Outcomes.of_numbers("t.csv", dict(zip(rows, places, strict=True)))
    found = check_rows(replace(found, word=column), names, there, others=True)
    return [rows[int(place[0])] for place in places_of(names, found).values()]


def test_rows_give_the_number_behind_their_columns_name(tmp_path):
    path = table(tmp_path, "throw_id,x,y\n1,0.8,0.1\n2,0.9,0.2\n3,1,0\n")
    names = ["throw_1_take2", "throw_2_take3", "throw_3_take1"]
    read = check_rows(read_outcomes(path), names, names)
    assert [x for x, *_ in places_of(names, read).values()] == [0.8, 0.9, 1.0]
    assert missing_outcomes(["throw_3_take1", "throw_4_take2"], read) == ["throw_4_take2"]


def test_two_numbers_that_fit_all_rows_are_refused_until_rows_are_called_by_the_recordings():
    names = ["throw_1_take2", "throw_2_take1"]
    with pytest.raises(InvalidDemonstrationsError, match=r"throw_1_take2 may be row 1 or row 2: "):
        paired(names, ["1", "2"])
    assert paired(names, names[::-1]) == names


def test_a_recording_whose_rows_are_counted_is_no_table_of_outcomes(tmp_path):
    for i in range(2):
        rows = [f"{k / 10},{k},{np.sin(k / 4 + i)}" for k in range(20)]
        (tmp_path / f"throw_{i}.csv").write_text("\n".join(["t,take,joint1", *rows]))
    assert len(read_recordings(tmp_path)) == 2


def test_what_has_no_outcome_is_left_out_by_name_and_no_throw_that_has_one():
    t = np.arange(20) * 0.05
    there, back = (Recording(str(i), t, np.linspace(i, 1 - i, 20)[:, None]) for i in (0, 1))
    outcomes = Outcomes.of_numbers("a table", {"1": (0.8, 0.1)})
    with pytest.raises(InvalidDemonstrationsError, match=r"--leave-out 0$"):
        outcomes_of(["0", "1"], outcomes, partial(ways_back, [there, back]))


@pytest.mark.parametrize("name", ["results.csv", "outcomes (1).csv"])
def test_a_second_table_that_says_other_outcomes_is_named(tmp_path, name):
    folder = write_csv(tmp_path)
    path, other = write_outcomes(folder), folder / name
    other.write_text(path.read_text())
    assert import_demonstrations(folder).demonstrations.n == len(OUTCOMES)  # a copy
    other.write_text(path.read_text().replace("x,y", "score,tries"))
    assert import_demonstrations(folder).demonstrations.n == len(OUTCOMES)  # of something else
    other.write_text(path.read_text().replace("0.8,", "0.9,"))
    taken = import_demonstrations(folder)
    assert taken.demonstrations.outcomes_seen[0, 0] == 0.8
    assert shlex.join(["--outcomes", str(other)]) in taken.preview.text
    meant = import_demonstrations(folder, outcomes=other)
    assert meant.demonstrations.outcomes_seen[0, 0] == 0.9
    assert str(path) not in meant.preview.text


def test_the_file_that_a_row_names_beside_its_number_is_its_recording(recording, tmp_path):
    order = [3, 0, 5, 1, 4, 2]
    rows = [f"{k},{i}.csv,{','.join(map(str, OUTCOMES[str(i)]))}" for k, i in enumerate(order, 7)]
    path = table(tmp_path, "\n".join(["episode,file,x,y", *rows]))
    for names in (None, ("x", "y")):
        seen = import_demonstrations(recording, outcomes=path, outcome_names=names)
        np.testing.assert_allclose(seen.demonstrations.outcomes_seen, list(OUTCOMES.values()))


def test_columns_of_targets_that_are_left_out_are_named(recording, tmp_path):
    rows = [f"{row},1,0" for row in rows_of_outcomes()]
    path = table(tmp_path, "\n".join(["episode,x,y,target_x,target_y", *rows]))
    result = import_demonstrations(recording, outcomes=path, outcome_names=("x", "y"))
    assert "target_x, target_y left out" in result.preview.text
    path.write_text(path.read_text().replace("target", "landing"))
    with pytest.raises(FileFormatError, match="landing_x, landing_y beside x, y"):
        import_demonstrations(recording, outcomes=path, outcome_names=("x", "y"))
