"""The page in a real browser, at a console that runs as a program of its own.

With PRIOR_REINFORCE_SCREENSHOTS=docs/images/console it writes the documentation's pictures.
"""

from __future__ import annotations

import os
import random
import shutil
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Error, Page, expect, sync_playwright

from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.lab.tasks import make_task
from tests.bench.console.pictures import SIZE, homography, jpeg, pixel
from tests.bench.console.served import CHROMIUM, Served
from tests.bench.workspace.planar import demonstrations, events_in, manifest, recordings

# Where tests of the page must run, as in CI, a browser that is missing is a failure.
pytestmark = pytest.mark.skipif(
    not Path(CHROMIUM).exists() and "PRIOR_REINFORCE_BROWSER" not in os.environ,
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

    def start(*, fresh=False, **how) -> Served:
        folder = tmp_path / f"planar-{len(started)}"
        if fresh:
            Workspace.create(folder, manifest()).close()
        else:
            shutil.copytree(learned_folder, folder)
        started.append(Served(folder, **how))
        return started[-1]

    yield start
    for each in started:
        each.end()


def opened(browser: Browser, served: Served, size=PHONE, **how) -> Page:
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, **how)
    context.set_default_timeout(60_000)
    page = context.new_page()
    page.faults = []
    page.on("pageerror", lambda error: page.faults.append(str(error)))
    page.goto(served.link)
    expect(page.locator("#now")).not_to_have_text("Connecting")
    expect(page.locator("#now")).not_to_have_text("Connection lost")
    return page


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
    folder = Path(os.environ.get("PRIOR_REINFORCE_SCREENSHOTS", tmp_path))
    if folder != tmp_path:
        page.wait_for_timeout(1200)  # what moves the arm cannot be pressed at once
    page.screenshot(path=folder / f"{name}.png")


def accessible(page: Page):
    found = Axe().run(page).response["violations"]
    assert not found, [(each["id"], each["nodes"][0]["html"]) for each in found]


def kinds(folder):
    return Counter(entry.kind for entry in events_in(folder))


def touch_until_it_hits(page: Page, served: Served, each=lambda step: None) -> int:
    """Execute, touch where it landed, until the goal is reached; how many trials it took."""
    for trials in range(1, 9):
        each("ready")
        page.click("#execute")
        expect(page.locator("#tell")).to_be_visible()
        touch(page, served.landed()[-1])
        each("touched")
        page.click("#tell")
        expect(page.locator("#execute, #again").first).to_be_visible()
        if page.locator("#again").is_visible():
            return trials
    raise AssertionError("never hit")


def test_from_recordings_to_a_hit_on_a_fresh_workspace(browser, serve, tmp_path):
    served = serve(fresh=True, seconds=1.5)
    recordings(tmp_path / "recorded", outcomes=())
    page = opened(browser, served)
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
    with Workspace(served.folder) as workspace:
        np.testing.assert_allclose(
            workspace.demonstrations.outcomes_seen, demonstrations().outcomes_seen, atol=0.003
        )
        for trial, landed in zip(workspace.state.trials, served.landed(), strict=True):
            goal = workspace.state.goal_of(trial)
            np.testing.assert_allclose(trial.reading.error_seen, landed - goal.goal, atol=0.003)
    assert not page.faults


@pytest.mark.slow
def test_six_recordings_of_a_panda_and_a_throw_in_contact_physics(browser, tmp_path):
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
        page = opened(browser, served, TABLET)
        shot(page, "panda-fresh", tmp_path)
        page.set_input_files("#files", sorted((tmp_path / "recorded").iterdir()))
        for i, place in enumerate(demos.outcomes_seen.tolist()):
            expect(page.locator("#now")).to_have_text(f"Where did throw_{i} land?")
            touch(page, place)
            page.click("#place")
        shot(page, "panda-recordings", tmp_path)
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
        page.evaluate("window.scrollTo(0, 0)")
        shot(page, "panda-reached", tmp_path)
        assert not page.faults
    finally:
        served.end()


@pytest.mark.parametrize("seed", range(RUNS))
def test_nothing_is_lost_or_executed_twice_whatever_happens(browser, serve, seed):
    """Reloads, killed consoles, two tabs that press at once, lost connections."""
    rng = random.Random(seed)
    served = serve(seconds=0.3)
    pages = [opened(browser, served) for _ in range(2)]
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


def test_two_tabs_see_the_same_and_the_late_one_is_told(browser, serve):
    served = serve()
    first, second = (opened(browser, served) for _ in range(2))
    touch(first, [0.9, 0.05])
    first.click("#goal")
    expect(second.locator("#execute")).to_be_visible()
    second.evaluate("refresh = () => {}; heard = () => {}")  # it sleeps, as a tablet does
    first.click("#execute")
    expect(first.locator("#tell")).to_be_visible()
    second.click("#execute")
    expect(second.locator("#alert")).to_contain_text("meanwhile: executing trial 1")
    assert len(served.landed()) == 1


def test_a_second_tap_meant_for_the_button_before_moves_nothing(browser, serve):
    served = serve()
    page = opened(browser, served)
    page.evaluate(
        """() => new MutationObserver((_, watch) => {
            const button = document.getElementById("execute");
            if (!button) return;
            watch.disconnect();
            button.click();
            document.body.id = "tapped";
        }).observe(document.getElementById("act"), { childList: true })"""
    )
    touch(page, [0.9, 0.05])
    page.click("#goal")
    expect(page.locator("#tapped")).to_be_visible()
    expect(page.locator("#execute")).to_be_enabled(timeout=10_000)
    page.click("#execute")
    expect(page.locator("#tell")).to_be_visible()
    assert len(served.landed()) == 1


def test_stop_stops_before_anything_is_known(browser, serve):
    page = opened(browser, serve())
    page.route("**/api/state", lambda route: route.abort())
    page.reload()
    with page.expect_request("**/api/stop"):
        page.click("#stop")


def test_stop_is_always_there_and_stops(browser, serve, tmp_path):
    served = serve(seconds=60)
    page = opened(browser, served)
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


def test_what_the_command_line_does_is_seen(browser, serve):
    served = serve()
    page = opened(browser, served)
    with Workspace(served.folder) as workspace:
        workspace.set_goal([0.9, 0.05])
        workspace.session().ask()
        expect(page.locator("#now")).to_have_text("Trial 1 is ready")
        workspace.session().tell(1, "5cm long")
    expect(page.locator("#history")).to_contain_text("5cm long")


def test_a_correction_and_a_void(browser, serve, tmp_path):
    served = serve()
    with Workspace(served.folder) as workspace:
        workspace.set_goal([0.9, 0.05])
        workspace.session().ask()
        workspace.session().tell(1, "20cm long")
        workspace.session().ask()
    page = opened(browser, served)
    page.click("#amend-1")
    touch(page, [0.95, 0.05])
    accessible(page)
    shot(page, "correct", tmp_path)
    page.click("#tell")
    expect(page.locator("#history")).not_to_contain_text("20cm long")
    with Workspace(served.folder) as workspace:
        seen = workspace.state.trials[0].reading.error_seen
        np.testing.assert_allclose(seen, [0.05, 0.0], atol=0.003)
    expect(page.locator("#act")).to_contain_text("Planned before a correction")
    page.click("#undo-1")
    page.click("#void-0")
    expect(page.locator("#history")).to_contain_text("void: it slipped")


def test_a_surprise_is_questioned(browser, serve, tmp_path):
    served = serve()
    with Workspace(served.folder) as workspace:
        workspace.set_goal([0.9, 0.05])
        for seen in ([0.01, 0.0], [0.0, 0.01], [0.4, -0.3]):
            session = workspace.session()
            session.tell(session.ask().number, seen, hit=False)
        workspace.session().ask()
        assert workspace.state.trials[-2].surprise
    page = opened(browser, served)
    expect(page.locator("#surprise")).to_contain_text("Mistyped?")
    accessible(page)
    shot(page, "surprise", tmp_path)
    page.click("#changed")
    expect(page.locator("#history")).to_contain_text("changed, as a surprise showed")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_by_the_keyboard_alone(browser, serve, tmp_path, scheme):
    served = serve()
    page = opened(browser, served, TABLET, color_scheme=scheme)
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
    shot(page, f"tablet-{scheme}", tmp_path)


@pytest.mark.parametrize("size", [PHONE, TABLET, SCREEN])
def test_a_touch_is_within_three_millimetres_over_the_table(browser, serve, size):
    served = serve()
    page = opened(browser, served, size, has_touch=True)
    for zoom in (1, 4):
        if zoom == 4:
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


def test_words_for_who_measures_by_eye(browser, serve, tmp_path):
    served = serve()
    page = opened(browser, served)
    touch(page, [0.9, 0.05])
    page.click("#goal")
    page.click("#execute")
    page.click("#sum-eye")
    page.locator("#eye-0-5").check(force=True)
    page.locator("#eye-1--2").check(force=True)
    accessible(page)
    shot(page, "by-eye", tmp_path)
    page.click("#say")
    expect(page.locator("#history")).to_contain_text("5cm long, 2cm right")
    with Workspace(served.folder) as workspace:
        assert workspace.state.trials[0].reading.said == "5cm long, 2cm right"


def test_the_camera_from_calibration_to_a_reading(browser, serve, tmp_path):
    served = serve()
    page = opened(browser, served, TABLET, permissions=["camera"])
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
    expect(page.locator("#history")).to_contain_text("cm")
    with Workspace(served.folder) as workspace:
        reading = workspace.state.trials[0].reading
        np.testing.assert_allclose(reading.error_seen, [0.03, 0.02], atol=0.005)
        assert reading.sd.max() <= 0.005
    assert not page.faults


def test_names_are_text_wherever_they_are_shown(browser, serve, tmp_path):
    served = serve()
    with Workspace(served.folder) as workspace:
        workspace.set_goal([0.9, 0.05], new_hardware="<img src=x onerror=window.hurt=1>")
        workspace.session().ask()
        workspace.session().void(1, "<script>window.hurt=1</script>")
    page = opened(browser, served)
    expect(page.locator("#history")).to_contain_text("<script>")
    assert page.evaluate("window.hurt") is None


def test_without_the_link_there_is_nothing_to_see(browser, serve):
    served = serve()
    page = browser.new_context().new_page()
    page.goto(served.address)
    expect(page.locator("#alert")).to_contain_text("open the one that the terminal shows")
    assert page.locator("#act button").count() == 0


def test_a_lost_console_is_said_and_comes_back(browser, serve, tmp_path):
    served = serve()
    page = opened(browser, served)
    served.kill()
    expect(page.locator("#now")).to_have_text("Connection lost")
    accessible(page)
    shot(page, "lost", tmp_path)
    served.start()
    expect(page.locator("#now")).to_have_text("Touch a goal")


def test_the_fake_camera_shows_the_table():
    assert SIZE == (1280, 720)
    u, v, w = homography() @ [0.9, 0.0, 1.0]
    assert 0 < u / w < SIZE[0]
    assert 0 < v / w < SIZE[1]
