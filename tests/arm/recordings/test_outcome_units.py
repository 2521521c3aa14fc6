"""Units of outcomes: as the table states them, converted, or asked about."""

import numpy as np
import pytest

from prior_reinforce.arm.recordings import import_demonstrations
from prior_reinforce.arm.recordings.outcome_units import in_units
from prior_reinforce.arm.recordings.outcomes import read_outcomes
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidDemonstrationsError,
    UnclearUnitsError,
)
from prior_reinforce.units import base_of
from tests.arm.recordings.recorded import (
    OUTCOMES,
    rows_of_outcomes,
    table,
    write_outcomes,
)


def test_centimetres_that_nobody_names_are_refused_until_said(recording, tmp_path):
    cm = {name: (100 * x, 100 * y) for name, (x, y) in OUTCOMES.items()}
    path = write_outcomes(tmp_path, cm)
    with pytest.raises(
        UnclearUnitsError, match=r"x reaches 105 and y reaches 14, too far for an arm"
    ):
        import_demonstrations(recording, outcomes=path)
    for said in ({"outcome_unit": "cm"}, {"take_guesses": True}):
        result = import_demonstrations(recording, outcomes=path, **said)
        np.testing.assert_allclose(result.demonstrations.outcomes_seen, list(OUTCOMES.values()))
    named = table(tmp_path, path.read_text().replace("x,y", "x_cm,y_cm"))
    with pytest.raises(ConfigurationError, match="--outcome-unit cm has no use"):
        import_demonstrations(recording, outcomes=named, outcome_unit="cm")


def test_an_angle_is_converted_to_the_unit_of_the_outcome(recording, tmp_path):
    text = "\n".join(["episode,angle_deg", *(f"{i},{10 * i + 1}" for i in range(6))])
    path = table(tmp_path, text)
    kept = import_demonstrations(recording, outcomes=path, outcome_units=["deg"]).demonstrations
    np.testing.assert_allclose(kept.outcomes_seen[:, 0], 10 * np.arange(6) + 1)
    radians = import_demonstrations(recording, outcomes=path, outcome_units=["rad"]).demonstrations
    np.testing.assert_allclose(radians.outcomes_seen[:, 0], np.deg2rad(10 * np.arange(6) + 1))


def test_one_uncertainty_is_of_one_unit(recording, tmp_path):
    path = table(
        tmp_path, "episode,x,turn,sd\n" + "".join(f"{i},{i},{int(i) % 2},1\n" for i in OUTCOMES)
    )
    with pytest.raises(
        ConfigurationError, match=r"sd in .* is one number for components in m, rad"
    ):
        import_demonstrations(recording, outcomes=path, outcome_units=("m", "rad"))


@pytest.mark.parametrize(("head", "unit"), [("episode,x [m],y [m]", None), ("episode,x,y", "m")])
def test_centimetres_that_are_said_to_be_metres_are_refused(recording, tmp_path, head, unit):
    rows = [f"{name},{100 * x},{100 * y}" for name, (x, y) in OUTCOMES.items()]
    path = table(tmp_path, "\n".join([head, *rows]))
    said = r"x is said to be in m and would reach 105 m.*call its column x \[cm\]"
    with pytest.raises(InvalidDemonstrationsError, match=said):
        import_demonstrations(recording, outcomes=path, outcome_unit=unit, take_guesses=True)


@pytest.mark.parametrize(
    ("head", "scale", "names", "units"),
    [
        ("angle [rad],apex [m]", (1, 1), ("angle", "apex"), ("rad", "m")),
        ("angle [deg],apex [cm]", (180 / np.pi, 100), ("angle", "apex"), ("rad", "m")),
        ("volume [ml],arrival [ms]", (1, 1000), ("volume", "arrival"), ("ml", "s")),
        ("arrival_ms,wait (s)", (1000, 1), ("arrival", "wait"), ("s", "s")),
        ("force [N],x (ahead)", (1, 1), ("force", "x (ahead)"), ("N", "m")),
    ],
)
def test_a_unit_in_the_tables_head_is_the_outcomes(recording, tmp_path, head, scale, names, units):
    rows = [f"{name},{scale[0] * x:.12g},{scale[1] * y:.12g}" for name, (x, y) in OUTCOMES.items()]
    path = table(tmp_path, "\n".join([f"episode,{head}", *rows]))
    result = import_demonstrations(recording, outcomes=path)
    assert result.demonstrations.outcome_format.names == names
    assert result.demonstrations.outcome_format.units == units
    np.testing.assert_allclose(result.demonstrations.outcomes_seen, list(OUTCOMES.values()))
    assert f"{names[0]} 0.8 to 1.05 {units[0]}" in result.preview.text


def test_metres_that_are_said_may_be_as_far_as_a_bat_strikes(recording, tmp_path):
    rows = [f"{name},{9 + x},{y}" for name, (x, y) in OUTCOMES.items()]
    path = table(tmp_path, "\n".join(["episode,x [m],y [m]", *rows]))
    said = import_demonstrations(recording, outcomes=path, outcome_unit="m")
    assert said.demonstrations.outcomes_seen.max() > 9
    with pytest.raises(UnclearUnitsError, match=r"10.05 m \(if that is in cm, .*--outcome-unit m"):
        import_demonstrations(recording, outcomes=path)  # a table that we wrote is headed so
    bare = table(tmp_path, "\n".join(["episode,x,y", *rows]))
    assert import_demonstrations(recording, outcomes=bare, outcome_unit="m").demonstrations.n == 6
    with pytest.raises(
        InvalidDemonstrationsError, match=r"x 10.05, y 0.14, .* --outcome-unit cm \(or m\)"
    ):
        import_demonstrations(recording, outcomes=bare)


def test_a_unit_with_a_side_is_told_how_to_say_the_side(recording, tmp_path):
    rows = [f"{name},{100 * x},{-100 * y}" for name, (x, y) in OUTCOMES.items()]
    read = {"outcome_names": ("x", "y"), "outcome_units": ("m", "m")}
    path = table(tmp_path, "\n".join(['episode,x [cm],"y [cm, positive right]"', *rows]))
    with pytest.raises(ConfigurationError, match="called right"):
        import_demonstrations(recording, outcomes=path, **read)
    path = table(tmp_path, "\n".join(["episode,x [cm],right [cm]", *rows]))
    kept = import_demonstrations(recording, outcomes=path, **read).demonstrations
    np.testing.assert_allclose(kept.outcomes_seen, list(OUTCOMES.values()))


def test_a_unit_that_the_task_does_not_have_says_where_it_stands(recording, tmp_path):
    rows = [f"{name},{x},{y}" for name, (x, y) in OUTCOMES.items()]
    path = table(tmp_path, "\n".join(["episode,x [ml],y [m]", *rows]))
    with pytest.raises(
        ConfigurationError, match=r"x in .* is in ml, but its unit is to be m; .*workspace.toml"
    ):
        import_demonstrations(recording, outcomes=path, outcome_units=("m", "m"))


@pytest.mark.parametrize(("head", "noise"), [("x [cm],y [cm]", 0.02), ("x [ms],y [ms]", 0.002)])
def test_how_uncertain_outcomes_are_is_in_the_unit_of_the_first(recording, tmp_path, head, noise):
    rows = [f"{name},{100 * x},{100 * y},2" for name, (x, y) in OUTCOMES.items()]
    path = table(tmp_path, "\n".join([f"episode,{head},sd", *rows]))
    demonstrations = import_demonstrations(recording, outcomes=path).demonstrations
    np.testing.assert_allclose(demonstrations.outcome_noise, noise)


def test_inches_in_the_head_or_said(recording, tmp_path):
    rows = [f"{name},{x / 0.0254},{y / 0.0254}" for name, (x, y) in OUTCOMES.items()]
    path = table(tmp_path, "\n".join(["episode,x [in],y (inches)", *rows]))
    kept = import_demonstrations(recording, outcomes=path).demonstrations
    np.testing.assert_allclose(kept.outcomes_seen, list(OUTCOMES.values()))
    bare = table(tmp_path, "\n".join(["episode,x,y", *rows]))
    with pytest.raises(UnclearUnitsError, match=r"looks like cm \(or inches: --outcome-unit in\)"):
        import_demonstrations(recording, outcomes=bare)
    said = import_demonstrations(recording, outcomes=bare, outcome_unit="in").demonstrations
    np.testing.assert_allclose(said.outcomes_seen, list(OUTCOMES.values()))


@pytest.mark.parametrize("head", ["x,y", "x [m],y [m]"])
@pytest.mark.parametrize("unit", [None, "cm"])
def test_a_row_in_another_unit_is_named(recording, tmp_path, head, unit):
    rows = [f"{name},{x},{y}" for name, (x, y) in OUTCOMES.items()]
    rows[3] = "3," + ",".join(f"{100 * number:g}" for number in OUTCOMES["3"])
    path = table(tmp_path, "\n".join([f"episode,{head}", *rows]))
    if unit and "[" in head:
        return
    with pytest.raises(InvalidDemonstrationsError, match="3 is in another unit than the others"):
        import_demonstrations(recording, outcomes=path, outcome_unit=unit, take_guesses=True)


@pytest.mark.parametrize("number", [-999, 1e308])
def test_what_was_not_measured_is_left_out_with_its_recording(recording, tmp_path, number):
    rows = [f"{name},{x},{y}" for name, (x, y) in OUTCOMES.items()]
    rows[3] = f"3,{number},{number}"
    path = table(tmp_path, "\n".join(["episode,x,y", *rows]))
    with pytest.raises(InvalidDemonstrationsError, match=r"3 .*not measured.*\(--leave-out\)"):
        import_demonstrations(recording, outcomes=path)
    for how in ({"leave_out": ["3"]}, {"episodes": ["0", "1", "2", "4", "5"]}):
        assert import_demonstrations(recording, outcomes=path, **how).demonstrations.n == 5


@pytest.mark.parametrize(("shift", "said"), [(0.0, True), (1.0, False)])
def test_an_outcome_at_the_base_is_named_unless_others_lie_around_it(tmp_path, shift, said):
    places = [(0.9 - 1.5 * shift * (i > 2), 0.1 * (-1) ** i) for i in range(6)]
    rows = [f"{i},{x},{y}" for i, (x, y) in enumerate([*places, (0, 0)])]
    found, asked = in_units(
        read_outcomes(table(tmp_path, "\n".join(["episode,x,y", *rows]))), None, None
    )
    assert (["6 landed at 0" in one for one in found.remarks], asked) == ([True] * said, ())


def test_a_spread_as_large_as_the_outcomes_lie_apart_is_doubted(recording, tmp_path):
    rows = [f"{name},{x},{y},0.5" for name, (x, y) in OUTCOMES.items()]
    path = table(tmp_path, "\n".join(["episode,x,y,sd", *rows]))
    said = r"sd in .* is up to 0.5 m, and all outcomes are within 0.25 m .*: sd \[cm\], or sd \[m\]"
    with pytest.raises(InvalidDemonstrationsError, match=said):
        import_demonstrations(recording, outcomes=path)
    for unit, noise in (("cm", 0.005), ("m", 0.5)):
        head = f"episode,x,y,sd [{unit}]"
        found = import_demonstrations(
            recording, outcomes=table(tmp_path, "\n".join([head, *rows]))
        ).demonstrations
        np.testing.assert_allclose(found.outcome_noise, noise)


def test_a_spread_of_a_metre_is_doubted_however_few_throws_there_are(tmp_path):
    path = table(tmp_path, "episode,x,y,sd\n0,0.9,0.1,1\n")
    with pytest.raises(
        InvalidDemonstrationsError, match=r"sd in .* is up to 1 m; .*: sd \[cm\], or"
    ):
        in_units(read_outcomes(path), None, None)
    for unit, sd in (("cm", 0.01), ("m", 1.0)):
        path.write_text(f"episode,x,y,sd [{unit}]\n0,0.9,0.1,1\n")
        np.testing.assert_allclose(in_units(read_outcomes(path), None, None)[0].sd, sd)


def test_one_unit_of_all_is_named_before_one_for_each(tmp_path):
    path = table(tmp_path, "episode,x,y\n0,90,-2\n1,100,0\n2,120,3\n")
    said = r"--outcome-unit cm \(or m\) if all are in that, else .*: x \[cm\], y \[m\]\)"
    with pytest.raises(InvalidDemonstrationsError, match=said):
        in_units(read_outcomes(path), None, None)
    np.testing.assert_allclose(in_units(read_outcomes(path), None, "cm")[0].values[2], [1.2, 0.03])


def test_a_column_may_end_in_inches_where_the_task_has_that_name(tmp_path):
    (tmp_path / "outcomes.csv").write_text("episode,distance_in,plug_in\n0,10,1\n1,12,2\n")
    found = read_outcomes(tmp_path / "outcomes.csv", ["distance"])
    np.testing.assert_allclose(found.values, [[0.254], [0.3048]])
    assert found.units == ("m",)
    assert read_outcomes(tmp_path / "outcomes.csv").names == ("distance_in", "plug_in")


@pytest.mark.parametrize("unit", ["mm", "cm"])
def test_lengths_of_one_table_have_one_unit(recording, tmp_path, unit):
    scale = 1 / base_of(unit)[1]
    path = table(tmp_path, "\n".join(["episode,x,y", *rows_of_outcomes((scale, scale))]))
    with pytest.raises(UnclearUnitsError, match=f"like {unit}") as asked:
        import_demonstrations(recording, outcomes=path)
    assert asked.value.options == f"--outcome-unit {unit}"
    seen = import_demonstrations(recording, outcomes=path, outcome_unit=unit)
    np.testing.assert_allclose(seen.demonstrations.outcomes_seen, list(OUTCOMES.values()))


@pytest.mark.parametrize("scale", [(1, 100), (100, 1), (1, 1000)])
def test_lengths_in_two_units_have_to_be_said_each(recording, tmp_path, scale):
    path = table(tmp_path, "\n".join(["episode,x,y", *rows_of_outcomes(scale)]))
    with pytest.raises(InvalidDemonstrationsError, match=r"several units: .* in the head"):
        import_demonstrations(recording, outcomes=path)
    units = [{1: "m", 100: "cm", 1000: "mm"}[each] for each in scale]
    head = f"episode,x [{units[0]}],y [{units[1]}]"
    path = table(tmp_path, "\n".join([head, *rows_of_outcomes(scale)]))
    seen = import_demonstrations(recording, outcomes=path).demonstrations.outcomes_seen
    np.testing.assert_allclose(seen, list(OUTCOMES.values()))


def judged(tmp_path, head, rows, unit=None):
    """The outcomes in metres of a table of rows numbered from 0."""
    lines = [f"{i},{row}" for i, row in enumerate(rows.split())]
    path = table(tmp_path, "\n".join([f"episode,{head}", *lines]))
    wanted = ["m"] * (head.count(",") + 1)
    return in_units(read_outcomes(path), wanted, unit)[0].values


@pytest.mark.parametrize(
    ("head", "rows", "unit"),
    [
        ("x_cm,y_cm", "80,5 86,-7 0.92,0.02 98,-11", None),
        ("x_cm,y_cm", "80,5 86,-7 1.05,0.02 98,-11", None),
        ("x_mm,y_mm", "800,50 860,-70 92,2 980,-110", None),
        ("x [in],y [in]", "31,2 34,-3 0.92,0.02 39,-4", None),
        ("x,y", "80,5 86,-7 0.92,0.02 98,-11", "cm"),
        ("x,y", "80,5 86,-7 0.92,0.02 98,-11", None),
        ("x_cm", "80 86 0.92 98", None),
        ("x_m,y_m", "0.8,0.05 0.86,-0.07 92,2 0.98,-0.11", None),
        ("x,y", "0.8,0 0.86,0 0.9,95 0.98,0", None),
        ("x_m,y_m", "0.03,0.01 0.02,-0.01 2.5,0.4 0.04,0", None),
    ],
)
def test_a_row_that_is_as_the_others_in_another_unit_is_named(tmp_path, head, rows, unit):
    with pytest.raises(InvalidDemonstrationsError, match="2 is in another unit"):
        judged(tmp_path, head, rows, unit)


@pytest.mark.parametrize(
    ("head", "rows", "unit"),
    [
        ("x_cm,y_cm", "80,5 -86,7 0.1,0.2 3,98", None),
        ("x_cm,y_cm", "80,5 -86,7 9,2 3,98", None),
        ("x_cm,y_cm", "80,5 -86,7 0,0 3,98", None),
        ("x,y", "0.8,0.05 -0.86,0.07 0.01,0.01 0.03,0.98", None),
        ("x_cm,y_cm", "80,5 0.92,0.02 98,-11", None),
        ("x_cm,y_cm", "80,5 86,-7 0.92,0.02 98,-11", "m"),
        ("y_cm", "-11 -7 2 5 0.05", None),
    ],
)
def test_a_row_near_the_base_is_in_no_other_unit(tmp_path, head, rows, unit):
    assert len(judged(tmp_path, head, rows, unit)) == len(rows.split())


def test_angles_and_times_may_be_small(tmp_path):
    path = table(tmp_path, "episode,a_deg,t_ms\n0,40,800\n1,50,900\n2,0.8,0.9\n3,55,950\n")
    assert len(in_units(read_outcomes(path), ["rad", "s"], None)[0].values) == 4


@pytest.mark.parametrize(
    ("head", "rows", "unit", "guessed"),
    [
        ("x_cm,y", "80,2.3 105,-1.8", "cm", False),
        ("x [mm],y", "800,2.3 1050,-1.8", "mm", False),
        ("x_cm,y", "80,23 105,-18", "cm", True),
    ],
)
def test_a_length_without_a_unit_beside_one_of_a_unit_is_asked_about(
    tmp_path, head, rows, unit, guessed
):
    text = [f"{i},{row}" for i, row in enumerate(rows.split())]
    found = read_outcomes(table(tmp_path, "\n".join([f"episode,{head}", *text])))
    seen, (doubt,) = in_units(found, ["m", "m"], None)
    assert (doubt.option, doubt.guessed) == (f"--outcome-unit {unit}", guessed)
    assert f"beside x in {unit}" in doubt.what
    scale = base_of(unit)[1]
    np.testing.assert_allclose(seen.values, found.values * [1, scale])
    confirmed, none = in_units(found, ["m", "m"], unit)
    np.testing.assert_allclose(confirmed.values, seen.values)
    assert none == ()


def test_the_deviation_of_a_length_without_a_unit_is_in_its_unit(tmp_path):
    found = read_outcomes(table(tmp_path, "episode,y,x_cm,sd\n0,23,80,2\n1,-18,105,3\n"))
    np.testing.assert_allclose(in_units(found, ["m", "m"], None)[0].sd, (0.02, 0.03))
