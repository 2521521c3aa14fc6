"""The report: a verdict, a line a check, the same as plain data, and a refusal that names all."""

import json

import pytest

from prior_reinforce.arm.robots.report import LimitLine, LimitReport
from prior_reinforce.errors import RobotLimitError

FAST = LimitLine(
    check="velocity",
    status="refuse",
    value=2.25,
    limit=2.175,
    margin=-0.075,
    unit="rad/s",
    joint="joint4",
    time=0.5,
    text="joint4 at 2.25 rad/s",
)
NEAR = LimitLine(check="position", status="warn", text="joint2 near its end")
FINE = LimitLine(check="jerk", status="pass", text="joint1 at 5")
LACKS = LimitLine(check="joints", status="warn", text="not in the plan: joint4")
NO_BOX = LimitLine(check="box", status="unchecked", text="not checked: no box given")


def report(*lines):
    return LimitReport("panda", "any", "its maker", lines)


@pytest.mark.parametrize(
    ("lines", "verdict"),
    [
        ((FINE,), "plan passes: limits of panda (firmware any)\n"),
        ((FINE, NO_BOX), "plan passes: limits of panda (firmware any); not checked: box\n"),
        ((FINE, NEAR), "plan passes with warnings: "),
        ((FAST, NEAR), "plan refused: "),
        ((LimitLine(check="velocity", status="unchecked", text=""),), "plan NOT CHECKED for the "),
        ((LACKS, FINE), "plan NOT CHECKED for every joint: "),
    ],
)
def test_the_verdict_is_that_of_the_worst_line(lines, verdict):
    assert report(*lines).text().startswith(verdict)


def test_the_text_has_a_line_a_check():
    assert report(FAST, NO_BOX).text().splitlines()[1:] == [
        "  REFUSE velocity       joint4 at 2.25 rad/s",
        "    -    box            not checked: no box given",
    ]


def test_it_is_plain_data():
    data = json.loads(json.dumps(report(FAST, NO_BOX).as_json(), allow_nan=False))
    assert (data["refused"], data["warned"], data["unchecked"]) == (True, False, ["box"])
    assert data["source"] == "its maker"
    assert data["lines"][0] == {
        "check": "velocity",
        "status": "refuse",
        "value": 2.25,
        "limit": 2.175,
        "margin": -0.075,
        "unit": "rad/s",
        "joint": "joint4",
        "time": 0.5,
        "text": "joint4 at 2.25 rad/s",
    }


def test_every_refusal_is_named():
    report(NEAR, NO_BOX).require()
    broken = LimitLine(check="jerk", status="refuse", text="joint1 at 9000")
    with pytest.raises(
        RobotLimitError, match=r"velocity: joint4 at 2\.25 .*; jerk: joint1 at 9000"
    ):
        report(FAST, broken).require()
    restless = LimitLine(check="rest at start", status="refuse", text="joint1 at 0.059 rad/s")
    for lines, said in (((FAST,), False), ((FAST, restless), True)):
        match = "learn with another --generator.*--smooth 20 or less"
        with pytest.raises(RobotLimitError, match=match) as refused:
            report(*lines).require()
        assert ("--no-trim" in str(refused.value)) is said
