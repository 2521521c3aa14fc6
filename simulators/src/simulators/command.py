"""`python -m simulators`: an arm that is not there, for the programs that drive one that is."""

from __future__ import annotations

import csv
import signal
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import tyro

from prior_reinforce.commands.simulated import TaskChoice
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.files import claim_folder, named_disk_errors
from prior_reinforce.formats import in_tolerances
from prior_reinforce.plans.interpolation import RATE, interpolate
from prior_reinforce.simulation.tasks import make_task
from prior_reinforce.wording import say_reading

if TYPE_CHECKING:
    from collections.abc import Callable

    from prior_reinforce.environment import Rollout, Task
    from prior_reinforce.simulation.tasks.panda_task import PandaTask
    from simulators.fr3 import SimulatedFR3
    from simulators.ur import SimulatedUR


@dataclass(frozen=True)
class Simulate:
    """Serve a simulated arm, with a task's objects before it, until Ctrl-C.

    For example:
        python -m simulators fr3 --goal 1.05 0.10
        python -m simulators so101 --hand
    """

    arm: Annotated[Literal["fr3", "so101", "ur"], tyro.conf.Positional]
    """Which: fr3 (Franka Research 3, for libfranka's clients), so101 (for LeRobot), ur (UR5e, for
    ur_rtde, with no object before it)."""
    task: TaskChoice = ""
    host: str = "127.0.77.1"
    """Address of this computer to serve on; each simulated arm needs its own."""
    goal: tuple[float, ...] = ()
    """Say of each throw how far it was from here, whatever goal a workspace has by then, as
    somebody sees it who stands beside: 1.0 0.05, in the outcome's units."""
    recordings: Path | None = None
    """Serve nothing, but write recordings of the task's six demonstrations to this folder, as the
    arm measured them, and where each ended."""
    folder: Path = Path("so101")
    """Of an so101: for its serial port, and the calibration that LeRobot reads."""
    hand: bool = False
    """Of an so101: a hand guides it, or its leader, through six throws, once it has no torque."""
    leader: bool = False
    """Of an so101: serve a leader arm too."""
    lock_step: bool = False
    """Of an so101: its time passes with every goal, so that a busy computer changes no throw."""

    def run(self) -> None:
        """Serve, or write."""
        if self.arm == "ur":
            if self.task or self.goal or self.recordings is not None:
                raise ConfigurationError("no object lies before a simulated ur; give --host alone")
            from simulators.ur import SimulatedUR

            self._serve(SimulatedUR(self.host, lambda said: print(said, flush=True)), "a UR5e")
            return
        from prior_reinforce.simulation.tasks.panda_task import PandaTask

        usual = {"fr3": "basketball-fr3", "so101": "so101"}[self.arm]
        task = make_task(self.task or usual)
        if not isinstance(task, PandaTask) or ((self.arm == "so101") != (task.name == "so101")):
            raise ConfigurationError(f"{self.task} is no task of this arm; choose {usual}")
        if self.recordings is not None and self.arm == "so101":
            raise ConfigurationError("--recordings are an fr3's; record an so101 with: record")
        if self.recordings is not None:
            _record(task, self.recordings)
            return
        if self.goal and len(self.goal) != task.outcome_format.outcome_dim:
            raise ConfigurationError(f"--goal needs {task.outcome_format.outcome_dim} numbers")
        if self.arm == "so101":
            self._serve_so101(task)
            return
        from simulators.fr3 import SimulatedFR3

        arm = SimulatedFR3(task, self.host, self._observer(task))
        self._serve(arm, task.name)

    def _serve(self, arm: SimulatedFR3 | SimulatedUR, what: str) -> None:
        """Serve at an address until Ctrl-C."""

        def stop(*_: object) -> None:
            arm.running = False

        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, stop)
        ready = f"{self.arm} serves {what} at {self.host}; Ctrl-C ends it"
        arm.serve(lambda: print(ready, flush=True))

    def _serve_so101(self, task: Task) -> None:
        from simulators.so101 import manifest_section, serve

        say = self._observer(task)
        section = manifest_section(self.folder, leader=self.leader, lock_step=self.lock_step)
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        with suppress(KeyboardInterrupt):
            serve(
                self.folder,
                say,
                hand=self.hand,
                leader=self.leader,
                lock_step=0.01 if self.lock_step else None,
                ready=lambda: print(f"{section}\n# so101 is served; Ctrl-C ends it", flush=True),
            )

    def _observer(self, task: Task) -> Callable[[Rollout], None]:
        """Says where the object went, and what an observer would call that.

        It is made before an arm is served: made at a landing, it kept the arm from answering.
        """
        from prior_reinforce.perception import make_perception

        goal, eye = np.array(self.goal), make_perception("eye")
        form = task.outcome_format.within(task.tolerance)

        def say(rollout: Rollout) -> None:
            if not rollout.valid:
                print("the object went where no outcome is; by eye: lost", flush=True)
                return
            numbers = zip(form.names, rollout.outcome, form.units, strict=True)
            said = ", ".join(f"{name} {value:.4f} {unit}" for name, value, unit in numbers)
            if self.goal:
                seen = eye.perceive(rollout, goal, np.random.default_rng(0))
                hit = in_tolerances(rollout.outcome - goal, form.tolerance) <= 1
                said += f"; by eye, of --goal: {say_reading(seen, form)}{', a hit' if hit else ''}"
            print(f"the object came down at {said}", flush=True)

        return say


def _record(task: PandaTask, folder: Path) -> None:
    """Execute a task's demonstrations, and write what the arm measured and where each ended."""
    from simulators.stepped import SteppedTask

    claim_folder(folder)
    rows = [["episode", *task.outcome_format.names]]
    for i, plan in enumerate(task.demonstrations("A").plans, start=1):
        stepped = SteppedTask(task, plan[0])
        stepped.begin()
        every, motion = 10, interpolate(plan, task.format.dt, hold_after=task.lead_out)
        q = []
        for target in motion.q:
            q.append(stepped.q)
            stepped.step(target)
        outcome = stepped.end().outcome
        n = len(plan) * round(task.format.dt * RATE)
        name = f"throw-{i}"
        np.savez(
            folder / f"{name}.npz",
            t=motion.t[:n:every],
            q=np.array(q)[:n:every],
            joint_names=task.format.names,
        )
        rows.append([name, *(f"{place:.4f}" for place in outcome)])
    with named_disk_errors(folder), (folder / "outcomes.csv").open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    print(f"written: {len(rows) - 1} recordings and outcomes.csv in {folder}")
