"""The page: whole in one file, numbers as told, nothing of the outside world."""

import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from prior_reinforce.adapters.base import Expectation
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.parsing import from_words
from prior_reinforce.report import page, record_film, write_report
from prior_reinforce.report.record import CheckRow
from tests.report.swing_world import FullStep, adaptation, demonstrations, pictures, told

FACTS = {
    "Seeds": "training 0, goals 1",
    "Made by": "a <b>generator</b> & $x$",
    "Remarks": "demonstration 3 never rests, so start times are not learned",
}
REGION = [[0.80, -0.32], [1.08, 0.32]]
TABLE = "The whole table, as seen from behind the robot."
_VOID_TAGS = {"meta", "img", "br", "link", "input", "hr"}


class StrictReader(HTMLParser):
    """Collects text and addresses; every tag must be closed by its own end."""

    def __init__(self):
        super().__init__()
        self.open, self.text, self.addresses, self.alts = [], [], [], []

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.addresses += [values[name] for name in ("src", "href", "poster") if name in values]
        if tag == "img":
            self.alts.append(values["alt"])
        if tag not in _VOID_TAGS:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.text.append(data)


def read(path):
    reader = StrictReader()
    reader.feed(path.read_text(encoding="utf-8"))
    reader.close()
    assert reader.open == []
    reader.words = " ".join(" ".join(reader.text).split())
    return reader


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """Two goals: the first with a voided trial and a film, the second without."""
    demos = demonstrations()
    first, second = (
        adaptation(goal, seed=seed, demos=demos)
        for seed, goal in enumerate(([0.92, 0.10], [1.0, -0.22]))
    )
    film = record_film(pictures(12), tmp_path_factory.mktemp("film"), "throw")
    missing = "No film: this machine has no OpenGL."
    return (
        replace(first, title="<script>alert(1)</script>", film=film, film_caption="The hit."),
        replace(second, film_caption=missing),
    )


@pytest.fixture(scope="module")
def report(records, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    path = write_report(folder, records, title="Two & two", facts=FACTS, region=REGION)
    return path, read(path)


def test_the_page_needs_no_other_file_and_no_network(report):
    path, reader = report
    assert path.name == "report.html"
    assert all(address.startswith(("data:", "#")) for address in reader.addresses)
    html = re.sub(r"data:[a-z/0-9]+;base64,[A-Za-z0-9+/=]+", "", path.read_text())
    assert not re.search(r"https?:|//|url\(|@import|<link|<script", html)


def test_numbers_appear_as_told(report, records):
    words = report[1].words
    counts = [r.trials_to_hit for r in records]
    assert "2 of 2 goals reached" in words
    assert TABLE in words
    mean = np.mean(counts)
    assert f"N = 6 demonstrations + {mean:.1f} trials = {6 + mean:.1f}" in words
    assert "92 cm ahead, 10 cm left" in words
    assert "100 cm ahead, 22 cm right" in words
    assert "voided: ball slipped" in words
    assert "No film: this machine has no OpenGL." in words
    assert "training 0, goals 1" in words
    assert "Remarks demonstration 3 never rests, so start times are not learned" in words
    first = records[0].trials[0]
    long, left = first.error_seen * 100
    said = f"{abs(long):g} cm {'long' if long > 0 else 'short'}"
    assert f"{said}, {abs(left):g} cm {'left' if left > 0 else 'right'}" in words
    assert f"{np.linalg.norm(first.error_seen) * 100:.1f}".rstrip("0").rstrip(".") + " cm" in words


def test_no_number_is_missing(report):
    assert not re.search(r"\b(nan|inf|None)\b", report[1].words, re.IGNORECASE)
    assert not any(re.search(r"\b(nan|None)\b", alt) for alt in report[1].alts)


def test_what_users_write_is_escaped(report):
    path, reader = report
    assert "<script>alert" not in path.read_text()
    assert "<script>alert(1)</script>" in reader.words
    assert "a <b>generator</b> & $x$" in reader.words


def test_every_picture_says_what_it_shows(report):
    assert len(report[1].alts) == 2 + 2 * 5 + 1
    assert all(len(alt) > 20 for alt in report[1].alts)
    assert any("voided: ball slipped" in alt for alt in report[1].alts)


def test_pictures_are_sharp_at_any_size_and_lie_beside_the_page(report):
    folder = report[0].parent
    names = [*(f"goal-1-{name}" for name in ("landings", "aims", "errors", "plans", "table"))]
    for name in (*names, "overview", "trials-by-goal"):
        svg = (folder / f"{name}.svg").read_text()
        assert "<path" in svg
        assert "<text" not in svg  # which would need the reader's fonts
        assert "<image" not in svg
    assert not list(folder.glob(".*"))
    assert not list(folder.glob("goal-*.png"))


def test_goals_are_folded_but_for_the_last(report):
    assert re.findall(r'<details class="goal"( open|)>', report[0].read_text()) == ["", " open"]


def test_what_is_known_beside_the_trials_is_on_the_page(tmp_path):
    photograph = tmp_path / "seen.png"
    Image.new("RGB", (8, 8)).save(photograph)
    record = told([0.05, 0.0], [0.02, 0.0])
    first, second = record.trials
    first = replace(first, expected=Expectation(0.34, 1.9))
    record = replace(
        record,
        trials=(first, replace(second, hit=True)),
        notes=("Set on 2026-05-04; new on the hardware: <smaller> ball.",),
        measured={2: (np.linspace(0.0, 1.0, 50), np.zeros((50, 7)))},
        photographs=(("Trial 1, as it was looked at.", photograph),),
    )
    reader = read(write_report(tmp_path / "report", [record], title="x"))
    for text in (
        "A hit, to go",
        "possible, 1.9",
        "new on the hardware: <smaller> ball",
        "called 2 cm ✓",
        "that it hit was seen directly",
        "Dotted: the path that was measured on the arm",
        "Trial 1, as it was looked at.",
    ):
        assert text in reader.words
    assert sum(address.startswith("data:image/png") for address in reader.addresses) == 1
    unsaid = read(write_report(tmp_path / "other", [told([0.05, 0.0])], title="x")).words
    for text in ("A hit", "Dotted", "seen directly"):
        assert text not in unsaid


@pytest.mark.parametrize(
    ("k", "units", "said"),
    [
        (1, ("m",), "as perceived; long is beyond the goal, short before it."),
        (3, ("m", "m", "m"), "high is above the goal, low below it."),
        (2, ("m", "s"), "short before it; late is after the goal's time"),
    ],
)
def test_the_words_that_are_explained_are_those_of_the_task(k, units, said, tmp_path):
    record = adaptation(seed=1, k=k, units=units, action_dim=1, most=1)
    words = read(write_report(tmp_path, [record], title="x")).words
    assert said in words
    assert ("seen from behind" in words) == (k > 1 and "s" not in units)


def test_the_same_trials_give_the_same_bytes(records, report, tmp_path):
    again = write_report(tmp_path, records, title="Two & two", facts=FACTS, region=REGION)
    assert again.read_bytes() == report[0].read_bytes()


@pytest.mark.parametrize(
    ("k", "units", "action_dim"),
    [(1, ("m",), 1), (3, ("m", "m", "m"), 9), (2, ("m", "s"), 2)],
)
def test_other_outcomes_and_plans_are_reported_too(k, units, action_dim, tmp_path):
    record = adaptation(seed=1, k=k, units=units, action_dim=action_dim, most=3)
    reader = read(write_report(tmp_path, [record], title="other"))
    if k == 1:
        assert TABLE not in reader.words
    assert ("Goal reached" in reader.words) or ("Goal not reached yet" in reader.words)
    if units == ("m", "s"):
        assert "distance 0.9 m, duration 0.1 s" in reader.words
        assert "cm" not in reader.words.replace("within 1.5 cm and 15 ms", "")
    else:
        assert "90 cm ahead" in reader.words


def test_nothing_is_loaded_to_draw_with_before_anything_is_drawn():
    code = (
        "import sys, prior_reinforce.report as r; r.write_report, r.record_film;"
        "print(*sorted({'matplotlib', 'jinja2', 'imageio', 'PIL'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert run.stdout == "\n"


def test_a_goal_not_tried_yet_has_a_report(tmp_path):
    record = adaptation(seed=1, most=0)
    reader = read(write_report(tmp_path, [record], title="before"))
    assert "Goal not reached yet" in reader.words
    assert "not tried yet" in reader.words
    assert "N =" not in reader.words


def test_goals_keep_their_numbers_and_only_what_shows_something_is_drawn(tmp_path):
    records = [replace(told([0.05, 0.0]), number=3), replace(told(None), number=7)]
    mine = ("goal-2-photo.png", "goal-of-my-thesis-plans.svg")
    for name in ("report.html", "goal-2-errors.svg", "goal-2-aims.svg", *mine):
        (tmp_path / name).write_bytes(b"there before")
    drawn = []
    path = write_report(
        tmp_path, records, title="x", note="No plan was given for goal 5.",
        progress=lambda done, n: drawn.append((done, n)),
    )  # fmt: skip
    assert drawn == [(1, 2), (2, 2)]
    words = read(path).words
    assert "Goal 3" in words
    assert "Goal 7 no trial that counts" in words
    assert "No plan was given for goal 5." in words
    names = {picture.name for picture in tmp_path.glob("goal-*.*")}
    assert names == {
        *(f"goal-3-{name}.svg" for name in ("table", "landings", "aims", "errors", "plans")),
        *(f"goal-7-{name}.svg" for name in ("table", "aims", "plans")),
        *mine,
    }


def test_where_there_was_no_report_nothing_is_removed(tmp_path):
    (tmp_path / "goal-12-plans.svg").write_bytes(b"mine")
    write_report(tmp_path, [told([0.05, 0.0])], title="x")
    assert (tmp_path / "goal-12-plans.svg").read_bytes() == b"mine"


def test_only_goals_that_changed_are_drawn_again_and_all_where_other_code_draws(
    tmp_path, monkeypatch
):
    def written(*records):
        write_report(tmp_path, records, title="x")
        return {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("goal-*.svg")}

    over, current = replace(told([0.05, 0.0]), number=1), replace(told([0.05, 0.0]), number=2)
    before = written(over, current)
    (tmp_path / "goal-1-table.svg").write_text("<svg>cut off")
    after = written(over, replace(told([0.05, 0.0], [0.0, 0.02]), number=2))
    again = {name for name in before if after[name] != before[name]}
    names = ("table", "landings", "aims", "errors", "plans")
    assert again == {"goal-1-table.svg", *(f"goal-2-{name}.svg" for name in names)}
    before = written(over)
    monkeypatch.setattr(page, "__file__", str(tmp_path / "of-another-version" / "page.py"))
    after = written(over)
    assert all(after[name] != before[name] for name in before)


def test_a_page_stays_small_and_loads_pictures_of_early_goals_from_beside_it(tmp_path, monkeypatch):
    records = [replace(told([0.05, 0.0]), number=number) for number in (1, 2)]
    whole = write_report(tmp_path, records, title="x").stat().st_size
    monkeypatch.setattr(page, "LARGEST_PAGE", whole * 2 // 3)
    path = write_report(tmp_path, records, title="x")
    assert path.stat().st_size < whole * 3 // 4
    beside = [a for a in read(path).addresses if not a.startswith(("data:", "#"))]
    assert beside
    assert all((tmp_path / address).is_file() for address in beside)
    assert all(address.startswith("goal-1-") for address in beside)


def test_a_large_film_lies_beside_the_page(records, tmp_path, monkeypatch):
    monkeypatch.setattr(page, "LARGEST_INLINE_FILE", 10)
    reader = read(write_report(tmp_path, records[:1], title="large"))
    assert "throw.mp4" in reader.addresses
    assert (tmp_path / "throw.mp4").read_bytes() == records[0].film.video.read_bytes()


def test_bad_input_is_named_and_writes_nothing(tmp_path):
    folder = tmp_path / "report"
    with pytest.raises(ConfigurationError, match="at least one adaptation"):
        write_report(folder, [], title="none")
    with pytest.raises(ConfigurationError, match=r"region must have shape \(2, 2\)"):
        write_report(folder, [adaptation(adapter=FullStep(), most=1)], title="x", region=[1, 2])
    with pytest.raises(ConfigurationError, match=r"two goals go by one number in \[2, 2\]"):
        write_report(folder, [replace(told(), number=2), told()], title="x")
    assert not folder.exists()


def test_what_the_gate_said_stands_beside_the_plans(report, tmp_path):
    checks = (
        CheckRow("velocity", "warn", 2, "joint4 at 2.1 rad/s, 97 % of 2.175"),
        CheckRow("box", "unchecked", 1, "not checked: no box given"),
    )
    record = replace(told([0.05, 0.0]), checks=checks)
    words = read(write_report(tmp_path, [record], title="x")).words
    assert "What the gate said of these plans" in words
    assert "velocity passes, warns joint4 at 2.1 rad/s, 97 % of 2.175 2" in words
    assert "box not checked" in words
    assert "What the gate said" not in report[1].words


def test_a_direction_alone_is_said_to_be_dashed_and_no_goal_reached_that_was_not(tmp_path):
    seen = told([0.05, 0.0])
    vague = replace(seen.trials[0], reading=from_words("long, somewhere"))
    for record, dashed in ((seen, False), (replace(seen, trials=(vague,)), True)):
        words = read(write_report(tmp_path / f"{dashed}", [record], title="t")).words
        assert ("Dashed: only the direction was seen." in words) == dashed
        assert "; counts as reached within 1.5 cm" in words
