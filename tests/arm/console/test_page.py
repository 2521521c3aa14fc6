"""The page in a real browser, at a console: a program of its own where it is to be killed.

With PRIOR_REINFORCE_SCREENSHOTS=docs/images/console it writes the pictures there anew.
"""

from __future__ import annotations

import itertools
import os
import random
import re
import shutil
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Error, Page, expect, sync_playwright

from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks import make_task
from tests.arm.console.pictures import SIZE, homography, jpeg, pixel
from tests.arm.console.served import CHROMIUM, Here, OnArm, Secure, Served
from tests.arm.executing import toy_arm
from tests.arm.workspace.planar import FORMAT, demonstrations, events_in, manifest, recordings

# Where tests of the page must run, as in CI, a browser that is missing is a failure.
pytestmark = pytest.mark.skipif(
    not Path(CHROMIUM).exists() and "PRIOR_REINFORCE_REQUIRED" not in os.environ,
    reason=f"no {CHROMIUM}: apt-get install chromium",
)
expect.set_options(timeout=60_000)  # a busy machine; what never comes still fails
PHONE, TABLET, SCREEN = (390, 844), (1180, 820), (1920, 1080)
RUNS = int(os.environ.get("PRIOR_REINFORCE_RUNS", "2"))
"""How many disturbed runs; `make test` makes few."""


@pytest.fixture(scope="module")
def feed(tmp_path_factory):
    """What the browser's camera shows: a table with a ball."""
    path = tmp_path_factory.mktemp("feed") / "table.mjpeg"
    path.write_bytes(jpeg(ball=(0.93, 0.07)) * 2)
    return path


@pytest.fixture(scope="module")
def browser(feed):
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM,
            args=[
                "--no-sandbox",
                "--use-fake-ui-for-media-stream",
                "--use-fake-device-for-media-stream",
                f"--use-file-for-fake-video-capture={feed}",
            ],
        )
        yield browser
        browser.close()


@pytest.fixture
def serve(tmp_path, learned_folder):
    """Serve a copy of a small workspace, fresh or with a model."""
    started = []

    def learned(folder):
        shutil.copytree(learned_folder, folder)

    def start(kind=Here, *, prepare=learned, folder=None, **how) -> Served:
        if folder is None:
            folder = tmp_path / f"planar-{len(started)}"
            prepare(folder)
        started.append(kind(folder, **how))
        return started[-1]

    yield start
    for each in started:
        each.end()


def fresh(folder):
    Workspace.create(folder, manifest()).close()


@pytest.fixture
def at(browser, serve):
    """Open a page at a console; closed before that ends, or it asks on and on."""
    contexts = []

    def open_(served: Served, size=PHONE, **how) -> Page:
        contexts.append(browser.new_context(viewport={"width": size[0], "height": size[1]}, **how))
        contexts[-1].set_default_timeout(60_000)
        page = contexts[-1].new_page()
        page.faults = []
        page.on("pageerror", lambda error: page.faults.append(str(error)))
        page.goto(served.link)
        expect(page.locator("#now")).not_to_have_text("Connecting")
        expect(page.locator("#now")).not_to_have_text("Connection lost")
        return page

    yield open_
    for each in contexts:
        each.close()


def on_screen(page: Page, place, svg="map"):
    """Where a place of the table, or a pixel of the picture, is on the screen, in whole pixels."""
    u, v = (-1000 * place[1], -1000 * place[0]) if svg == "map" else place
    x, y = page.evaluate(
        """([id, u, v]) => {
          const svg = document.getElementById(id);
          svg.scrollIntoView({ block: "start" });
          window.scrollBy(0, -document.querySelector("header").offsetHeight);
          const at = new DOMPoint(u, v).matrixTransform(svg.getScreenCTM());
          return [at.x, at.y];
        }""",
        [svg, u, v],
    )
    return round(x), round(y)


def touch(page: Page, place, svg="map"):
    page.mouse.click(*on_screen(page, place, svg))


def shot(page: Page, name: str, tmp_path: Path):
    shown = Path(os.environ.get("PRIOR_REINFORCE_SCREENSHOTS", tmp_path)) / f"{name}.png"
    if shown.exists():  # in the documentation
        page.wait_for_timeout(1200)  # what moves the arm cannot be pressed at once
        page.screenshot(path=shown)
    page.screenshot(path=tmp_path / f"{name}.png")


def accessible(page: Page):
    found = Axe().run(page).response["violations"]
    assert not found, [(each["id"], each["nodes"][0]["html"]) for each in found]


def wholly_seen(page: Page, selector: str) -> bool:
    """Whether nothing covers or cuts an element off, at its middle and its corners."""
    return page.evaluate(
        """(selector) => {
          const wanted = document.querySelector(selector);
          const { left, right, top, bottom } = wanted.getBoundingClientRect();
          const [x, y] = [(left + right) / 2, (top + bottom) / 2];
          return [[x, y], [x, top + 3], [x, bottom - 3]].every((at) =>
            wanted.contains(document.elementFromPoint(...at)));
        }""",
        selector,
    )


def kinds(folder):
    return Counter(entry.kind for entry in events_in(folder))


def touch_until_it_hits(page: Page, served: Served, each=lambda step: None) -> int:
    """Execute, touch where it landed, until the goal is reached; how many trials it took."""
    for trials in range(1, 9):
        each("ready")
        page.click("#execute")
        expect(page.locator("#tell")).to_be_visible()
        expect(page.locator("#act details:has(#sum-said)")).to_contain_text("3 of 3")
        touch(page, served.landed()[-1])
        each("touched")
        page.click("#tell")
        expect(page.locator("#execute, #again").first).to_be_visible()
        if page.locator("#again").is_visible():
            return trials
    raise AssertionError("never hit")


def test_from_recordings_to_a_hit_on_a_fresh_workspace(at, serve, tmp_path):
    served = serve(prepare=fresh, seconds=1.5)
    recordings(tmp_path / "recorded", outcomes=())
    page = at(served)
    accessible(page)
    shot(page, "fresh", tmp_path)
    page.set_input_files("#files", sorted((tmp_path / "recorded").iterdir()))
    for i, place in enumerate(demonstrations().outcomes_seen.tolist()):
        expect(page.locator("#now")).to_have_text(f"Where did throw_{i} land?")
        touch(page, place)
        if i == 2:
            accessible(page)
            shot(page, "outcome", tmp_path)
        page.click("#place")
    expect(page.locator("#import")).to_have_text("Import 4 recordings")
    shot(page, "recordings", tmp_path)
    page.click("#import")
    page.click("#learn")
    expect(page.locator("#now")).to_have_text("Touch a goal")
    touch(page, [0.9, 0.05])
    shot(page, "goal", tmp_path)
    page.click("#goal")

    def each(step):
        accessible(page)
        shot(page, f"trial-{step}", tmp_path)

    trials = touch_until_it_hits(page, served, each)
    expect(page.locator("#now")).to_have_text(
        f"Reached in {trials} trial{'s' if trials > 1 else ''}"
    )
    accessible(page)
    shot(page, "reached", tmp_path)
    page.click("#again")  # which counts no more than the throws until it was reached
    page.click("#execute")
    expect(page.locator("#tell")).to_be_visible()
    touch(page, served.landed()[-1])
    page.click("#tell")
    shown = f"N = 4 demonstrations + {trials} trial{'s' if trials > 1 else ''} = {4 + trials}"
    expect(page.locator("#act")).to_contain_text(shown)
    expect(page.locator("#now")).to_contain_text(f"Reached in {trials} trial")
    with Workspace(served.folder) as workspace:
        np.testing.assert_allclose(
            workspace.demonstrations.outcomes_seen, demonstrations().outcomes_seen, atol=0.003
        )
        for trial, landed in zip(workspace.state.trials, served.landed(), strict=True):
            goal = workspace.state.goal_of(trial)
            np.testing.assert_allclose(trial.reading.error_seen, landed - goal.goal, atol=0.003)
    assert not page.faults


@pytest.mark.slow
def test_six_recordings_of_a_panda_and_a_throw_in_contact_physics(at, tmp_path):
    demos = make_task("basketball-v1").demonstrations("A")
    form, folder = demos.format, tmp_path / "basketball"
    Workspace.create(folder, robot="panda", action_names=form.names, dt=form.dt).close()
    (tmp_path / "recorded").mkdir()
    for i, plan in enumerate(demos.plans):
        t = np.arange(len(plan)) * form.dt
        path = tmp_path / "recorded" / f"throw_{i}.npz"
        np.savez(path, t=t, q=plan, joint_names=np.array(form.names))
    served = Served(folder, "basketball-v1", 1.0)
    try:
        page = at(served, TABLET)
        page.set_input_files("#files", sorted((tmp_path / "recorded").iterdir()))
        for i, place in enumerate(demos.outcomes_seen.tolist()):
            expect(page.locator("#now")).to_have_text(f"Where did throw_{i} land?")
            touch(page, place)
            page.click("#place")
        page.click("#import")
        page.click("#learn")
        expect(page.locator("#now")).to_have_text("Touch a goal")
        touch(page, [0.95, 0.08])
        page.click("#goal")
        expect(page.locator("#plan")).to_contain_text("passes")
        page.click("#sum-joints")
        expect(page.locator(".joints")).to_contain_text("rad")
        assert page.locator(".joints svg").count() == 7
        page.click("#sum-gate")
        page.locator("#when").fill("700")
        page.locator("#when").dispatch_event("input")
        accessible(page)
        page.evaluate("window.scrollTo(0, 0)")
        shot(page, "panda-plan", tmp_path)
        page.set_viewport_size(dict(zip(("width", "height"), PHONE, strict=True)))
        page.click("#sum-joints")
        page.click("#sum-gate")

        def each(step):
            page.evaluate("window.scrollTo(0, 0)")
            shot(page, f"panda-{step}", tmp_path)

        touch_until_it_hits(page, served, each)
        assert not page.faults
    finally:
        served.end()


@pytest.mark.parametrize("seed", range(RUNS))
def test_nothing_is_lost_or_executed_twice_whatever_happens(at, serve, seed):
    """Reloads, killed consoles, two tabs that press at once, lost connections."""
    rng = random.Random(seed)
    served = serve(Served, seconds=0.3)
    pages = [at(served) for _ in range(2)]
    touch(pages[0], [0.9, 0.05])
    pages[0].click("#goal")
    told = 0
    deadline = time.monotonic() + 400
    while served.get("/api/state")["step"] != "reached":
        assert time.monotonic() < deadline
        page = rng.choice(pages)
        disturbance = rng.choice(["reload", "kill", "lost", "both", "none"])
        state = served.get("/api/state")
        try:
            if disturbance == "reload":
                page.reload()
            elif disturbance == "lost":
                page.context.set_offline(True)
                page.context.set_offline(False)
            step = state["step"]
            if step == "execute":
                for each in pages if disturbance == "both" else [page]:
                    each.click("#execute", timeout=5000, no_wait_after=True)
                if disturbance == "kill":
                    time.sleep(rng.random())
                    served.kill()
                    served.start()
            elif step == "tell":
                before = served.landed()[-1]
                touch(page, before)
                page.click("#tell", timeout=5000, no_wait_after=True)
                if disturbance == "kill":
                    served.kill()
                    served.start()
            elif step == "settle":  # killed before the arm had begun to move, or after
                moved = len(served.landed()) > told
                page.click("#moved" if moved else "#still", timeout=5000)
                if moved:
                    touch(page, served.landed()[-1])
                    page.click("#tell", timeout=5000)
            elif step == "ask":
                page.click("#ask", timeout=5000)
        except Error as error:
            if "Timeout" not in str(error):
                raise  # a button that was not there: the page had gone on, or is lost
        told = len([t for t in served.get("/api/state")["trials"] if t["stage"] == "told"])
        time.sleep(0.2)
    with Workspace(served.folder) as workspace:
        trials = [trial for trial in workspace.state.trials if trial.reading is not None]
        assert len(served.landed()) == len(trials)
        for trial, landed in zip(trials, served.landed(), strict=True):
            goal = workspace.state.goal_of(trial)
            np.testing.assert_allclose(trial.reading.error_seen, landed - goal.goal, atol=0.004)
    for page in pages:
        expect(page.locator("#again")).to_be_visible()
        assert not page.faults


def test_two_tabs_see_the_same_and_the_late_one_is_told(at, serve):
    served = serve()
    first, second = (at(served) for _ in range(2))
    touch(first, [0.9, 0.05])
    first.click("#goal")
    expect(second.locator("#execute")).to_be_visible()
    second.evaluate("refresh = () => {}; heard = () => {}")  # it sleeps, as a tablet does
    first.click("#execute")
    expect(first.locator("#tell")).to_be_visible()
    second.click("#execute")
    expect(second.locator("#alert")).to_contain_text("not done: moving trial 1")
    assert len(served.landed()) == 1


def tapped_at_once(page: Page, button: str):
    """Press a button as soon as it is there."""
    page.evaluate(
        """(button) => new MutationObserver((_, watch) => {
            const found = document.getElementById(button);
            if (!found) return;
            watch.disconnect();
            found.click();
            document.body.id = "tapped";
        }).observe(document.getElementById("act"), { childList: true })""",
        button,
    )


def test_a_second_tap_meant_for_the_button_before_moves_nothing(at, serve):
    served = serve()
    page = at(served)
    tapped_at_once(page, "execute")
    touch(page, [0.9, 0.05])
    page.click("#goal")
    expect(page.locator("#tapped")).to_be_visible()
    expect(page.locator("#execute")).to_be_enabled(timeout=10_000)
    page.click("#execute")
    expect(page.locator("#tell")).to_be_visible()
    assert len(served.landed()) == 1


def test_stop_stops_before_anything_is_known(at, serve):
    page = at(serve())
    page.route("**/api/state", lambda route: route.abort())
    page.reload()
    with page.expect_request("**/api/stop"):
        page.click("#stop")


def test_stop_is_always_there_and_stops(at, serve, tmp_path):
    served = serve(seconds=60)
    page = at(served)
    touch(page, [0.9, 0.05])
    page.click("#goal")
    page.click("#execute")
    expect(page.locator(".output")).to_contain_text("moving, 1 of 3")
    accessible(page)
    shot(page, "moving", tmp_path)
    page.reload()
    page.click("#stop")
    expect(page.locator("#now")).to_have_text("Did the arm move?")
    accessible(page)
    shot(page, "settle", tmp_path)
    page.click("#still")
    expect(page.locator("#execute")).to_be_visible()
    assert not served.landed()


UNREACHED = (
    "The arm may still be moving. Stop on this page does NOT reach it: use the arm's own stop "
    "button."
)


def test_a_page_whose_console_is_gone_sends_to_the_arms_own_button(at, serve, tmp_path):
    served = serve(Served, seconds=4)
    pages = {"phone": at(served), "tablet": at(served, TABLET, color_scheme="dark")}
    touch(pages["phone"], [0.9, 0.05])
    pages["phone"].click("#goal")
    pages["phone"].click("#execute")
    for name, page in pages.items():
        expect(page.locator("#stop")).to_have_class(re.compile("armed"))
        expect(page.locator(".output")).to_contain_text("moving")
        shot(page, f"before-{name}", tmp_path)
    served.kill()
    for name, page in pages.items():
        expect(page.locator("#act .danger")).to_have_text(UNREACHED)
        expect(page.locator("#stop")).not_to_have_class(re.compile("armed"))
        assert page.locator("#act button").count() == 0
        assert wholly_seen(page, "#act .danger")
        page.click("#stop")
        expect(page.locator("#alert")).to_contain_text("No answer to Stop.")
        accessible(page)
        shot(page, f"lost-{name}", tmp_path)
    served.start()
    for page in pages.values():
        expect(page.locator("#moved, #tell").first).to_be_visible()
        assert page.locator("#act .danger").count() == 0
        assert not page.faults


def test_a_page_that_was_never_answered_says_so_too(at, serve):
    page = at(serve())
    page.route("**/api/*", lambda route: route.abort())
    page.reload()
    expect(page.locator("#act .danger")).to_have_text(UNREACHED)
    page.unroute("**/api/*")
    expect(page.locator("#now")).to_have_text("Touch a goal")


def test_a_stop_that_is_not_answered_is_not_waited_for(at, serve):
    page = at(serve())
    held = []
    page.route("**/api/stop", lambda route: held.append(route))
    page.click("#stop")
    expect(page.locator("#alert")).to_contain_text("use the arm's own stop button")
    held[0].continue_()
    expect(page.locator("#alert")).to_be_hidden()
    page.unroute("**/api/stop")
    page.route("**/api/stop", lambda route: route.fulfill(status=401, json={"error": "no"}))
    page.click("#stop")
    expect(page.locator("#alert")).to_have_text(
        "Stop is refused (no). Use the arm's own stop button."
    )


def test_a_journal_that_is_replaced_ends_what_the_page_offers(at, serve, tmp_path):
    served = serve()
    page = at(served)
    touch(page, [0.9, 0.05])
    page.click("#goal")
    expect(page.locator("#execute")).to_be_enabled()
    own = served.folder / "journal.sqlite"
    shutil.copy(own, tmp_path / "copy")
    own.rename(tmp_path / "first")
    (tmp_path / "copy").rename(own)
    expect(page.locator("#now")).to_have_text("The workspace cannot be read")
    expect(page.locator("#act")).to_contain_text("was replaced")
    assert page.locator("#act button, #map.touch").count() == 0
    accessible(page)
    shot(page, "replaced", tmp_path)
    page.click("#stop")
    expect(page.locator("#alert")).to_contain_text("stopped, whatever moved; but")
    page.reload()
    expect(page.locator("#now")).to_have_text("The workspace cannot be read")
    (tmp_path / "first").rename(own)
    expect(page.locator("#execute")).to_be_enabled()
    assert not served.landed()
    assert not page.faults


@pytest.mark.parametrize("size", [PHONE, TABLET])
def test_a_place_is_typed_from_field_to_field(at, serve, size):
    served = serve()
    page = at(served, size, has_touch=True)
    page.click("#sum-fields")
    page.tap("#field-0")
    page.keyboard.type("90,5")
    expect(page.locator("#goal")).to_have_text("Enter the y")
    page.keyboard.press("Tab")
    page.keyboard.type("-5")
    expect(page.locator("#field-1")).to_be_focused()
    assert [page.input_value(f"#field-{i}") for i in (0, 1)] == ["90,5", "-5"]
    page.tap("#field-0")
    field = page.locator("#field-0")
    expect(field).to_be_focused()
    # On a busy machine Chromium places the caret of a tap some tenths of a second after its focus.
    for _ in range(200):
        if field.evaluate("field => field.selectionStart") == len("90,5"):
            break
        page.keyboard.press("End")
    page.keyboard.press("Backspace")
    page.keyboard.press("Backspace")
    assert page.input_value("#field-0") == "90"
    page.tap("#field-1")
    expect(page.locator("#field-1")).to_be_focused()
    page.keyboard.type("x")
    expect(page.locator("#goal")).to_be_disabled()
    page.keyboard.press("Backspace")
    page.tap("#goal")
    expect(page.locator("#execute")).to_be_visible()
    with Workspace(served.folder) as workspace:
        np.testing.assert_allclose(workspace.state.goals[0].goal, [0.9, -0.05], atol=1e-9)


@pytest.mark.parametrize("typed", ["1.10 m", "12 right", "abc"])
def test_what_cannot_be_read_of_a_place_says_what_is_wanted(at, serve, typed):
    page = at(serve())
    page.click("#sum-fields")
    page.fill("#field-0", typed)
    expect(page.locator("#goal")).to_be_disabled()
    expect(page.locator("#unread-0")).to_have_text("Type a number alone, in cm")
    page.fill("#field-0", "1,10")
    expect(page.locator("#unread-0")).to_have_count(0)
    expect(page.locator("#read-0")).to_have_text("Read as 1.1 cm")
    page.fill("#field-0", "110")
    expect(page.locator("#read-0")).to_have_count(0)


def executed(at, serve):
    """A console and its page after a first trial, where it asks for words by eye."""
    served = serve()
    page = at(served)
    touch(page, [0.9, 0.05])
    page.click("#goal")
    page.click("#execute")
    page.click("#sum-eye")
    return served, page


def test_a_lost_object_is_told_as_lost(at, serve):
    served, page = executed(at, serve)
    page.click("#gone")
    expect(page.locator("#execute")).to_be_visible()
    with Workspace(served.folder) as workspace:
        assert workspace.state.trials[0].reading.lost


def test_columns_with_names_of_their_own_are_chosen(at, serve, tmp_path):
    page = at(serve(prepare=fresh))
    recordings(tmp_path / "recorded", outcomes=())
    for path in sorted((tmp_path / "recorded").iterdir()):
        with np.load(path) as arrays:
            changed = {**arrays, "joint_names": np.array(["shoulder", "elbow"])}
        np.savez(path, **changed)
    page.set_input_files("#files", sorted((tmp_path / "recorded").iterdir()))
    expect(page.locator("#act")).to_contain_text("choose those that are these joints")
    expect(page.locator("#columns")).to_be_disabled()
    page.select_option("#column-0", "shoulder")
    page.select_option("#column-1", "shoulder")
    expect(page.locator("#columns")).to_be_disabled()
    page.select_option("#column-1", "elbow")
    accessible(page)
    shot(page, "columns", tmp_path)
    page.click("#columns")
    for i, place in enumerate(demonstrations().outcomes_seen.tolist()):
        expect(page.locator("#now")).to_have_text(f"Where did throw_{i} land?")
        if i == 0:  # the table is where it can be touched
            assert page.evaluate("$('map').getBoundingClientRect().top >= 0")
            box = page.locator("#map").bounding_box()
            assert box["y"] + 200 < page.locator("#act").bounding_box()["y"]
            shot(page, "columns-outcome", tmp_path)
        touch(page, place)
        page.click("#place")
    page.click("#import")
    expect(page.locator("#learn")).to_be_visible()
    assert not page.faults


def test_what_the_command_line_does_is_seen_and_names_are_text(at, serve):
    served = serve()
    page = at(served)
    with Workspace(served.folder) as workspace:
        workspace.set_goal([0.9, 0.05], new_hardware="<img src=x onerror=window.hurt=1>")
        workspace.session().ask()
        expect(page.locator("#now")).to_have_text("Trial 1 is ready")
        workspace.session().tell(1, "5cm long")
        expect(page.locator("#history")).to_contain_text("5cm long")
        workspace.session().void(1, "<script>window.hurt=1</script>")
    expect(page.locator("#history")).to_contain_text("<script>")
    assert page.evaluate("window.hurt") is None


def test_a_surprise_is_questioned(at, serve, tmp_path):
    served = serve()
    with Workspace(served.folder) as workspace:
        workspace.set_goal([0.9, 0.05])
        for seen in ([0.01, 0.0], [0.0, 0.01], [0.4, -0.3]):
            session = workspace.session()
            session.tell(session.ask().number, seen, hit=False)
        workspace.session().ask()
        assert workspace.state.trials[-2].surprise
    page = at(served)
    expect(page.locator("#surprise")).to_contain_text("Mistyped?")
    accessible(page)
    shot(page, "surprise", tmp_path)
    page.click("#changed")
    expect(page.locator("#history")).to_contain_text("changed, as a surprise showed")


def test_by_the_keyboard_alone_in_the_dark(at, serve, tmp_path):
    served = serve()
    page = at(served, TABLET, color_scheme="dark")
    page.focus("#map")
    page.keyboard.press("ArrowUp")  # a mark, where nothing is known in the middle
    for _ in range(3):
        page.keyboard.press("ArrowUp")
    page.keyboard.press("Shift+ArrowLeft")
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    expect(page.locator("#execute")).to_be_visible()
    with Workspace(served.folder) as workspace:
        np.testing.assert_allclose(workspace.state.goals[0].goal, [0.83, 0.001], atol=1e-9)
    expect(page.locator("#live")).to_have_text("Trial 1 is ready. ")
    accessible(page)
    shot(page, "tablet-dark", tmp_path)


def test_a_touch_is_within_three_millimetres_over_the_table(at, serve):
    served = serve()
    for size, zoom in itertools.product((PHONE, TABLET, SCREEN), (1, 4)):
        if zoom == 1:
            page = at(served, size, has_touch=True)
        else:
            page.click("#nearer")
            page.click("#nearer")
        left, top, right, bottom = page.evaluate(
            "[view.x, view.y, view.x + view.w, view.y + view.h]"
        )
        inset = np.linspace(0.12, 0.88, 6)
        for s in inset:
            for t in inset:
                place = [-(top + s * (bottom - top)) / 1000, -(left + t * (right - left)) / 1000]
                x, y = on_screen(page, place)
                if (
                    page.evaluate(
                        "([x, y]) => document.elementFromPoint(x, y)?.closest('#map')", [x, y]
                    )
                    is None
                ):
                    continue  # a button, or the panel of the action, is over it
                page.touchscreen.tap(x, y)
                np.testing.assert_allclose(page.evaluate("L.mark"), place, atol=0.003)


def to_tell(page: Page):
    """A goal, and a plan that was executed: the page asks where it landed."""
    touch(page, [0.9, 0.05])
    page.click("#goal")
    page.click("#execute")
    expect(page.locator("#tell")).to_be_visible()


def test_what_was_unfolded_stays_so_whenever_the_page_is_drawn(at, serve):
    page = at(serve())
    to_tell(page)
    unfolded = page.locator("details:has(#sum-eye)")
    for state in (True, False):
        page.evaluate("$('sum-eye').click(); draw()")
        assert (unfolded.get_attribute("open") is not None) is state
        page.wait_for_timeout(100)
        page.evaluate("draw()")
        assert (unfolded.get_attribute("open") is not None) is state


def test_news_waits_for_the_finger_and_no_longer_than_two_seconds(at, serve):
    served = serve()
    page = at(served)
    touch(page, [0.9, 0.05])
    expect(page.locator("#goal")).to_be_enabled()
    page.evaluate(  # what stood out has been drawn
        """() => new Promise((go) => {
            const look = () => (calmAt < performance.now() ? go() : setTimeout(look, 20));
            look();
        })"""
    )
    early = """() => {
        window.early = 0;
        const now = draw;
        draw = () => { window.early += performance.now() < heldUntil; now(); };
    }"""
    page.evaluate(early)
    page.locator("#goal").hover()
    page.mouse.down()
    page.evaluate("heard({ output: 'said meanwhile' })")
    page.wait_for_timeout(200)
    assert page.evaluate("window.early") == 0
    page.mouse.up()  # the button that was touched is still there
    expect(page.locator("#execute")).to_be_enabled()
    page.locator("#now").hover()
    page.mouse.down()
    with Workspace(served.folder) as workspace:
        workspace.session().void(1, "nobody saw it")
    expect(page.locator("#history")).to_contain_text("nobody saw it")
    page.mouse.up()


def test_a_button_tells_the_state_it_was_drawn_from(at, serve):
    """A tap that news comes into is for what the page showed, and refused where that has passed."""
    served = serve()
    page = at(served)
    to_tell(page)
    page.locator("#hit").hover()
    page.mouse.down()
    seen = page.evaluate("S.id")
    with Workspace(served.folder) as workspace:
        workspace.session().tell(1, [0.2, 0.0])
    page.wait_for_timeout(700)
    assert page.evaluate("S.id") == seen
    page.mouse.up()
    expect(page.locator("#alert")).to_contain_text("not done: told trial 1")
    with Workspace(served.folder) as workspace:
        assert not workspace.state.trials[0].reading.hit


def test_an_event_is_drawn_once(at, serve):
    served = serve()
    page = at(served)
    page.wait_for_timeout(1500)  # what the first state draws late
    page.evaluate(
        "() => { window.drawn = 0; const now = draw; draw = () => { window.drawn += 1; now(); }; }"
    )
    with Workspace(served.folder) as workspace:
        workspace.set_goal([0.95, 0.0], adapter="proportional")
    expect(page.locator("#task")).to_contain_text("goal 1")
    page.wait_for_timeout(500)
    assert page.evaluate("window.drawn") == 1


def test_a_bare_hit_is_said_once_and_a_goal_that_was_given_up_is_not_on_the_map(at, serve):
    served = serve()
    with Workspace(served.folder) as workspace:
        for goal in ([0.9, 0.05], [0.85, 0.0]):
            workspace.set_goal(goal)
        workspace.session().tell(workspace.session().ask().number, "hit")
        workspace.set_goal([0.95, -0.05])
    page = at(served)
    expect(page.locator("#history")).to_contain_text("✓ hit (a hit was")
    expect(page.locator("#map path.goal")).to_have_count(2)  # that of now, and that was thrown at


@pytest.mark.filterwarnings("ignore:goal 500 cm ahead")
def test_a_mistyped_goal_is_said_on_the_page_and_scales_the_map_only_while_it_stands(at, serve):
    served = serve()
    with Workspace(served.folder) as workspace:
        workspace.set_goal([0.9, 0.05])
        page = at(served)
        shown = page.get_attribute("#map", "viewBox")
        for _ in range(2):  # each time, and where it is seen
            workspace.set_goal([5.0, 5.0])
            expect(page.locator("#far")).to_contain_text("check its unit")
            assert page.get_attribute("#map", "viewBox") != shown
            workspace.set_goal([0.9, 0.05])
            expect(page.locator("#far")).to_have_count(0)
            assert page.get_attribute("#map", "viewBox") == shown


def test_words_by_eye_then_a_correction_and_a_void(at, serve, tmp_path):
    served, page = executed(at, serve)
    page.locator("#eye-0-5").check(force=True)
    expect(page.locator("#tell")).to_have_text("Choose one in each row")
    page.locator("#eye-1--2").check(force=True)
    expect(page.locator("#tell")).to_have_text("Report: 5cm long, 2cm right")
    assert wholly_seen(page, "#tell")
    assert wholly_seen(page, "#eye-1--2")
    accessible(page)
    shot(page, "by-eye", tmp_path)
    page.click("#tell")
    expect(page.locator("#history")).to_contain_text("5cm long, 2cm right")
    expect(page.locator("#execute")).to_be_visible()
    with Workspace(served.folder) as workspace:
        assert workspace.state.trials[0].reading.said == "5cm long, 2cm right"
    page.click("#amend-1")
    touch(page, [0.95, 0.05])
    accessible(page)
    shot(page, "correct", tmp_path)
    page.click("#tell")
    expect(page.locator("#history")).not_to_contain_text("2cm right")
    with Workspace(served.folder) as workspace:
        seen = workspace.state.trials[0].reading.error_seen
        np.testing.assert_allclose(seen, [0.05, 0.0], atol=0.003)
    expect(page.locator("#act")).to_contain_text("Planned before a correction")
    page.click("#undo-1")
    page.click("#void-0")
    expect(page.locator("#history")).to_contain_text("void: it slipped")


LATE = """
const now = window.fetch;
window.fetch = async (path, options) => {
  const wait = String(path).startsWith("/api/picture") && !options.method ? 1500 : 0;
  return new Promise((go) => setTimeout(go, wait)).then(() => now(path, options));
};
"""
"""A page that gets the picture late, as over a slow connection."""


def test_the_camera_from_calibration_to_a_reading(at, serve, tmp_path):
    served = serve()
    page = at(served, TABLET, permissions=["camera"])
    page.evaluate(LATE)
    touch(page, [0.9, 0.05])
    page.click("#goal")
    page.click("#execute")
    expect(page.locator("#tell")).to_be_visible()
    page.click("#start")
    page.click("#take")
    page.click("#calibrate")
    known = page.evaluate("L.points")
    assert len(known) == 6
    for i, place in enumerate(known):
        page.click(f"#point-{i}")
        touch(page, pixel(place), "picture")
    accessible(page)
    shot(page, "calibrate", tmp_path)
    page.click("#fit")
    expect(page.locator("#camera")).to_contain_text("Calibrated to 0.")
    worst = 0.0
    for place in [(x, y) for x in (0.7, 0.9, 1.1) for y in (-0.3, 0.0, 0.3)]:
        touch(page, pixel(place), "picture")
        worst = max(worst, float(np.abs(np.array(page.evaluate("L.mark")) - place).max()))
    assert worst < 0.005
    page.click("#sum-find")
    page.fill("#size", "4")
    page.click("#colour")
    expect(page.locator("#tell")).to_contain_text("2.")
    accessible(page)
    shot(page, "found", tmp_path)
    page.click("#tell")
    expect(page.locator("#now")).to_have_text("Get the next plan")
    with Workspace(served.folder) as workspace:
        reading = workspace.state.trials[0].reading
        np.testing.assert_allclose(reading.error_seen, [0.03, 0.02], atol=0.005)
        assert reading.sd.max() <= 0.005
    assert not page.faults


def test_what_is_typed_beside_a_picture_is_read_as_it_stands_or_not_at_all(at, serve, tmp_path):
    """With a comma; a unit is not guessed, and no old value is kept silently."""
    served = serve()
    page = at(served, TABLET, permissions=["camera"])
    touch(page, [0.9, 0.05])
    page.click("#goal")
    page.click("#execute")
    page.click("#start")
    page.click("#take")
    page.click("#calibrate")
    for i, place in enumerate(page.evaluate("L.points")):
        page.click(f"#point-{i}")
        touch(page, pixel(place), "picture")
    right = page.input_value("#known-1-0")
    for wrong in ("24 in", ""):
        page.fill("#known-1-0", wrong)
        page.click("#known-1-1")
        expect(page.locator("#fit")).to_be_disabled()
        expect(page.locator("#fit")).to_contain_text("Point 2 is no number")
    shot(page, "unread", tmp_path)
    page.fill("#known-1-0", f"{right},0")
    page.click("#known-1-1")
    page.click("#fit")
    expect(page.locator("#camera")).to_contain_text("Calibrated to 0.")
    page.click("#sum-find")
    page.fill("#size", "4 cm")
    page.click("#colour")
    expect(page.locator("#alert")).to_contain_text("no number of centimetres")
    page.fill("#size", "2,4")  # of a ball of 4 cm
    page.click("#colour")
    expect(page.locator("#camera")).to_contain_text("is larger than it is")
    accessible(page)
    shot(page, "doubts", tmp_path)
    page.click("#tell")  # after which the next plan is got, of whose trial there is no picture yet
    expect(page.locator("#execute")).to_have_text(re.compile("Throw 2"))
    expect(page.locator("#photo")).to_have_count(1)
    expect(page.locator("#colour")).to_have_count(0)
    expect(page.locator("#map")).to_be_visible()
    shot(page, "next", tmp_path)
    page.click("#amend-1")
    expect(page.locator("#colour")).to_be_attached()
    assert not page.faults


def test_a_console_that_is_lost_comes_back_and_shows_nothing_without_the_link(
    at, serve, browser, tmp_path
):
    served = serve(Served)
    page = at(served)
    served.kill()
    expect(page.locator("#now")).to_have_text("Connection lost")
    accessible(page)
    shot(page, "lost", tmp_path)
    served.start()
    expect(page.locator("#now")).to_have_text("Touch a goal")
    stranger = browser.new_context().new_page()
    stranger.goto(served.address)
    expect(stranger.locator("#alert")).to_contain_text("open the one that the terminal shows")
    assert stranger.locator("#act button").count() == 0
    stranger.context.close()


@pytest.fixture
def on_arm(serve, learned_folder, tmp_path, toy_plugin):
    """A console whose manifest names a toy arm."""

    def start(**options):
        def prepare(folder):
            shutil.copytree(learned_folder, folder)
            toy_arm.name_arm(folder, tmp_path / "arm", **options)

        return serve(OnArm, prepare=prepare), tmp_path / "arm"

    return start


def looks_of(page: Page):
    """Of the button that lets the arm move, once it may be pressed."""
    expect(page.locator("#execute")).to_be_enabled()
    return page.evaluate(
        """() => {
            const [yes, no] = ["execute", "not-now"].map((id) => document.getElementById(id));
            const colour = getComputedStyle(yes).backgroundColor;
            const after = yes.compareDocumentPosition(no) & Node.DOCUMENT_POSITION_PRECEDING;
            return { colour, height: yes.offsetHeight, after_no: after > 0 };
        }"""
    )


def test_an_arm_is_asked_a_person_confirms_and_a_second_console_stops_it(
    at, on_arm, serve, tmp_path
):
    served, arm = on_arm(seconds=4)
    (arm / "pose").write_text("0.0 0.3")
    page = at(served)
    touch(page, [0.9, 0.05])
    page.click("#goal")
    tapped_at_once(page, "execute")
    page.click("#prepare")
    expect(page.locator("#question")).to_have_text(
        "The arm will move slowly to where trial 1 begins (1.9 s). NOT checked: self-collision, "
        "the table. Is the area clear?"
    )
    expect(page.locator("#execute")).to_have_text("Yes: move slowly to where trial 1 begins")
    slow = looks_of(page)
    accessible(page)
    shot(page, "arm-approach", tmp_path)
    expect(page.locator("#tapped")).to_be_visible()
    assert toy_arm.motions(arm) == 0
    page.click("#execute")
    expect(page.locator(".output")).to_contain_text("toy moves for 1.88 s")
    page.click("#prepare")
    expect(page.locator("#question")).to_have_text(
        "Trial 1 will run at FULL SPEED (0.5 s). NOT checked: self-collision, the table. "
        "Is the area clear?"
    )
    expect(page.locator("#act")).to_contain_text("toy, firmware 1.0: the arm is ")
    accessible(page)
    shot(page, "arm-question", tmp_path)
    expect(page.locator("#execute")).to_have_text("Throw 1 at FULL SPEED")
    fast = looks_of(page)
    assert all(fast[what] != slow[what] for what in ("colour", "height", "after_no")), (slow, fast)
    page.evaluate(  # a tap of before the question was drawn, handled only now
        """() => {
            const tap = new MouseEvent("click", { bubbles: true });
            Object.defineProperty(tap, "timeStamp", { value: performance.now() - 60000 });
            document.getElementById("execute").dispatchEvent(tap);
        }"""
    )
    expect(page.locator("#execute")).to_be_enabled()
    assert toy_arm.motions(arm) == 1
    page.click("#execute")
    second = at(serve(OnArm, folder=served.folder))
    expect(second.locator(".output")).to_contain_text("toy moves for 0.46 s")
    second.keyboard.press("Escape")
    for each in (page, second):
        expect(each.locator("#now")).to_have_text("Did the arm move?")
        expect(each.locator("#act")).to_contain_text("stopped by Ctrl-C, Stop")
    page.click("#spoiled")
    expect(second.locator("#history")).to_contain_text(
        "void: the command was stopped by Ctrl-C, Stop"
    )
    assert toy_arm.motions(arm) == 2
    assert not page.faults + second.faults


def test_a_fault_of_the_arm_voids_the_trial_after_a_question(at, on_arm, tmp_path):
    served, _ = on_arm(kind="faults")
    page = at(served)
    touch(page, [0.9, 0.05])
    page.click("#goal")
    page.click("#prepare")
    page.click("#execute")
    expect(page.locator("#act")).to_contain_text(f"but aborted: {toy_arm.FAULT}")
    accessible(page)
    shot(page, "arm-fault", tmp_path)
    assert kinds(served.folder)["voided"] == 0
    page.click("#spoiled")
    expect(page.locator("#history")).to_contain_text(f"void: {toy_arm.FAULT}")


def of_outcomes(names, units, tolerance, outcomes):
    """Make a workspace with a model, whose outcomes are other numbers than two lengths."""

    def prepare(folder):
        made = Workspace.create(
            *(folder,), robot="none", action_names=FORMAT.names, dt=FORMAT.dt,
            outcome_names=names, outcome_units=units, tolerance=tolerance,
        )  # fmt: skip
        with made as workspace:
            seen = np.array(outcomes)
            plans = demonstrations().plans[: len(seen)]
            demos = Demonstrations(plans, seen, FORMAT, OutcomeFormat(tuple(names), tuple(units)))
            workspace.import_demonstrations(demos, "made up")
            workspace.learn("interpolation")

    return prepare


def on_ruler(page: Page, number: int, value: float):
    """Touch a ruler where a value is."""
    x = page.evaluate("([i, value]) => rulers.find((r) => r.i === i).at(value)", [number, value])
    page.locator(f"#ruler-{number}").click(position={"x": x, "y": 58})


def test_one_number_has_a_ruler(at, serve, tmp_path):
    page = at(serve(prepare=of_outcomes(["distance"], ["m"], 0.02, [[0.8], [1.0], [1.2], [1.4]])))
    assert page.locator("#map").is_hidden()
    on_ruler(page, 0, 1.1)
    accessible(page)
    expect(page.locator("#goal")).to_have_text(re.compile(r"Aim at (109|110|111)(\.\d)? cm ahead"))
    page.keyboard.press("Shift+ArrowRight")
    page.click("#sum-fields")
    page.fill("#field-0", "110,5")
    page.keyboard.press("Tab")
    page.click("#goal")
    expect(page.locator("#execute")).to_be_visible()
    page.click("#sum-other")
    page.click("#by-hand")
    on_ruler(page, 0, 1.16)
    accessible(page)
    shot(page, "ruler", tmp_path)
    page.click("#tell")
    expect(page.locator("#history")).to_contain_text("cm long")
    seen = page.evaluate("[S.goals[0].goal, S.trials[0].outcome]")
    np.testing.assert_allclose(seen, [[1.105], [1.16]], atol=0.003)
    assert not page.faults


def test_lengths_are_on_the_map_and_a_time_beside_it(at, serve, tmp_path):
    outcomes = [[0.8, -0.2, 0.4], [0.8, 0.2, 0.45], [1.0, -0.2, 0.5], [1.0, 0.2, 0.6]]
    names, units, tolerance = ["x", "y", "arrival"], ["m", "m", "s"], [0.02, 0.02, 0.02]
    page = at(serve(prepare=of_outcomes(names, units, tolerance, outcomes)), TABLET)
    touch(page, [0.9, 0.05])
    expect(page.locator("#goal")).to_have_text("Enter the arrival")
    expect(page.locator("#goal")).to_be_disabled()
    on_ruler(page, 2, 0.5)
    page.click("#goal")
    expect(page.locator("#execute")).to_be_visible()
    page.click("#sum-other")
    page.click("#by-hand")
    touch(page, [0.95, 0.05])
    on_ruler(page, 2, 0.52)
    accessible(page)
    shot(page, "mixed", tmp_path)
    page.click("#sum-eye")
    for number, size in enumerate((5, -2, 20)):
        page.locator(f"#eye-{number}-{size}").check(force=True)
    expect(page.locator("#tell")).to_have_text("Report: 5cm long, 2cm right, 20ms late")
    page.click("#tell")
    expect(page.locator("#history")).to_contain_text("5cm long, 2cm right, 20ms late")
    assert not page.faults


def test_a_folder_that_is_dropped_is_walked(at, serve, tmp_path):
    page = at(serve(prepare=fresh))
    recordings(tmp_path / "recorded")
    (tmp_path / "recorded" / "outcomes.csv").rename(tmp_path / "outcomes.csv")
    for name, hidden in (("throws", "throw_0.npz"), ("more", ".DS_Store")):
        (tmp_path / "recorded" / name).mkdir()
        (tmp_path / "recorded" / name / hidden).touch()
    (tmp_path / "recorded" / "throws" / "throw_0.npz").unlink()
    x, y = (int(v) for v in page.evaluate(
        "(({x, y, width, height}) => [x + width / 2, y + height / 2])"
        "(document.getElementById('drop').getBoundingClientRect())"
    ))  # fmt: skip
    files = {"items": [], "files": [str(tmp_path / "recorded")], "dragOperationsMask": 1}
    devtools = page.context.new_cdp_session(page)
    for kind in ("dragEnter", "dragOver", "drop"):
        devtools.send("Input.dispatchDragEvent", {"type": kind, "x": x, "y": y, "data": files})
    expect(page.locator("#now")).to_have_text("Where did throw_0 land?")
    assert page.evaluate("R.files") == 4


def test_over_https_a_page_has_a_camera_at_every_address(at, browser, serve, certificate):
    served = serve(Secure, certificate=certificate)
    page = at(served, ignore_https_errors=True)
    touch(page, [0.9, 0.05])
    page.click("#goal")
    expect(page.locator("#execute")).to_be_visible()
    with pytest.raises(Error, match="ERR_CERT_AUTHORITY_INVALID"):
        at(served)


def test_the_fake_camera_shows_the_table():
    assert SIZE == (1280, 720)
    u, v, w = homography() @ [0.9, 0.0, 1.0]
    assert 0 < u / w < SIZE[0]
    assert 0 < v / w < SIZE[1]
