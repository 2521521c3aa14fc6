"""What holds for all tests: arrays have their annotated shapes, one thread each, no deadlines."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import subprocess
import zlib
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest
from threadpoolctl import threadpool_limits

from tests import tiers
from tests.shapes import check_shapes

# Before anything imports the package, or it stays unchecked.
check_shapes("prior_reinforce")
check_shapes("reproduction")
check_shapes("simulators")

# Threads that wait for each other by spinning crawl on a busy machine; two test processes are one.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MUJOCO_GL", "egl")
# How long something takes decides no test.
hypothesis.settings.register_profile("no deadline", deadline=None)
hypothesis.settings.load_profile("no deadline")
# Programs that tests start find the tests' own classes, and the package where the tests do.
here = (str(Path(__file__).parent), os.environ.get("PYTHONPATH"))
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, here))
# A shell's background job ignores interruptions, and so would all that these tests interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)
# Other tests that run at the same time move other arms.
os.environ["PRIOR_REINFORCE_ARM"] = f"tests-{os.getpid()}"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--most`."""
    parser.addoption("--most", type=float, help="Most processor time [s] of a quick test.")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Hold a quick test to `--most`."""
    most = item.config.getoption("--most")
    if most is None or item.get_closest_marker("quick") is None:
        yield
    else:
        yield from tiers.within(most)


def pytest_configure(config: pytest.Config) -> None:
    """Import the reproduction where its tests are run, and only there: it registers members.

    Now: pytest names its tests `reproduction.tests...`, and would take the folder for the package.
    """
    import simulators  # noqa: F401  # likewise

    if any("reproduction" in argument for argument in config.args):
        import reproduction  # noqa: F401


@pytest.fixture(scope="session", autouse=True)
def one_blas_thread() -> Iterator[None]:
    """The tests' matrices are small; torch sets its own number of threads."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """What collection makes stays: to look for garbage among it takes half of its time.

    Among what tests make it is looked for every 20,000 objects, and not every 700, to save time.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.set_threshold(20_000)
        gc.enable()
        gc.freeze()


@pytest.hookimpl(tryfirst=True)  # before tests are chosen by their marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark tests by tier, and start the longest first, or one process waits for them in the end.

    Files in no order, or all processes would wait at once, for the arms and browsers of a folder.
    """
    tiers.mark(items, str(config.rootpath))

    def place(item: pytest.Item) -> tuple[int, int]:
        if item.path.stem in ("test_notebook", "test_tutorial", "test_cluster"):
            return 0, 0
        file = zlib.crc32(str(item.path.relative_to(config.rootpath)).encode())
        return 1 if item.get_closest_marker("slow") else 2, file

    items.sort(key=place)


@pytest.fixture(scope="session")
def learned_folder(tmp_path_factory):
    """A small workspace with a model and no goal; copy it, never change it."""
    from prior_reinforce.arm.workspace.workspace import Workspace
    from tests.arm.workspace.planar import demonstrations, manifest

    folder = tmp_path_factory.mktemp("learned") / "planar"
    with Workspace.create(folder, manifest()) as workspace:
        workspace.import_demonstrations(demonstrations(), "made up")
        workspace.learn("interpolation")
    return folder


@pytest.fixture
def workspace(learned_folder, tmp_path):
    """A copy of it, with a goal."""
    from prior_reinforce.arm.workspace.workspace import Workspace

    shutil.copytree(learned_folder, tmp_path / "planar")
    with Workspace(tmp_path / "planar") as workspace:
        workspace.set_goal([0.9, 0.05])
        yield workspace


@pytest.fixture
def folder(learned_folder, tmp_path, monkeypatch):
    """A copy of it, in the folder that commands are called in; its name."""
    shutil.copytree(learned_folder, tmp_path / "planar")
    monkeypatch.chdir(tmp_path)
    return "planar"


@pytest.fixture
def run(capsys):
    """Call a command; its exit status, and what it printed and complained of."""
    from prior_reinforce.cli import main

    def call(*args):
        status = main([str(arg) for arg in args])
        said = capsys.readouterr()
        return status, said.out, said.err

    return call


@pytest.fixture(autouse=True)
def no_plugins_of_others() -> Iterator[None]:
    """Put back which plugins are named: a command leaves that to the programs that it starts."""
    from prior_reinforce.registry import PLUGINS

    before = os.environ.get(PLUGINS)
    yield
    os.environ.pop(PLUGINS, None)
    if before is not None:
        os.environ[PLUGINS] = before


@pytest.fixture
def toy_plugin(monkeypatch):
    """Programs that a test starts know the toy arm, as by `--plugins`."""
    monkeypatch.setenv("PRIOR_REINFORCE_PLUGINS", "tests.arm.executing.toy_arm")


@pytest.fixture(scope="session")
def lerobot(tmp_path_factory):
    """A Python with LeRobot."""
    from tests.arm.executing.lerobot_nursery import NO_LEROBOT, nursery

    if NO_LEROBOT:
        pytest.skip("no LeRobot; install it with: make lerobot")
    with nursery(tmp_path_factory.mktemp("lerobot")) as python:
        yield python


@pytest.fixture(scope="session")
def certificate(tmp_path_factory):
    """A certificate of 127.0.0.1 by nobody, and its key."""
    folder = tmp_path_factory.mktemp("certificate")
    made = (folder / "certificate.pem", folder / "key.pem")
    subprocess.run(
        [
            *("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256"),
            *("-nodes", "-days", "2", "-subj", "/CN=127.0.0.1"),
            *("-addext", "subjectAltName=IP:127.0.0.1", "-out", made[0], "-keyout", made[1]),
        ],
        check=True,
        capture_output=True,
    )
    return made
