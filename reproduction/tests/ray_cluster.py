"""Units on a Ray cluster of two local nodes, one of which is killed on the way.

    python reproduction/tests/ray_cluster.py FOLDER

A program of its own, because Ray warns, and stays around in the process that it was used in.
"""

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import ray
from quick_units import Ends, Roots, real_units, results
from ray.cluster_utils import Cluster

from prior_reinforce.registry import PLUGINS
from reproduction import cluster as ray_tasks
from reproduction.units import UnitFailedError, Workers, result_path, run_units

MEMORY = 80 * 2**20

VICTIM = "victim"
"""File that names the node to be killed."""

CONFIG = {"worker_niceness": 0}
"""Ray runs its workers at 15, where tests at their side leave them no processor for minutes."""


@dataclass(frozen=True)
class Watched(Roots):
    """Tells on which node it runs, and ends only after one of them began on the victim.

    On the victim it never ends: it is to be killed, however long that takes.
    """

    def run(self, folder):
        if ray.is_initialized():
            marks = folder.parent
            node = ray.get_runtime_context().get_node_id()
            victim = (marks / VICTIM).read_text()
            (marks / f"{self.seed} on {node}").touch()
            while node == victim or not list(marks.glob(f"* on {victim}")):
                time.sleep(0.05)
        return super().run(folder)


def nodes_of(folder, unit):
    return {path.name.split()[2] for path in folder.parent.glob(f"{unit.seed} on *")}


def main(folder: Path) -> None:
    os.environ[PLUGINS] = "quick_units"  # for the workers
    watched = [Watched(seed) for seed in range(4)]
    units = [*watched, *real_units()]
    reference = folder / "reference"
    run_units(units, reference, Workers(), lambda *_: None)

    options = {
        "num_cpus": 1,
        "include_dashboard": False,
        "object_store_memory": MEMORY,
        "_system_config": CONFIG,
    }
    cluster = Cluster(initialize_head=True, head_node_args=options)
    victim = cluster.add_node(num_cpus=1, object_store_memory=MEMORY)
    shared = folder / "ray"
    (folder / VICTIM).write_text(victim.node_id)

    def running_on_the_victim():
        return [
            unit
            for unit in watched
            if nodes_of(shared, unit) == {victim.node_id} and not result_path(shared, unit).exists()
        ]

    killed_with = []

    def progress(done, total, label):
        while done >= 2 and not killed_with:
            killed_with.extend(running_on_the_victim())
            if killed_with:
                cluster.remove_node(victim, allow_graceful=False)
            time.sleep(0.01)

    run_units(units, shared, Workers(ray=cluster.address), progress)
    ours, theirs = results(reference), results(shared)
    differ = [name for name in {*ours, *theirs} if ours.get(name) != theirs.get(name)]
    assert not differ, [(name, ours.get(name), theirs.get(name)) for name in differ]
    assert all(len(nodes_of(shared, unit)) == 2 for unit in killed_with)
    print(f"{len(units)} units done, {len(killed_with)} of them twice")

    ray_tasks._RETRIES = 0
    for how in ("raise", "die"):
        try:
            run_units([Ends(how)], shared, Workers(ray=cluster.address), lambda *_: None)
        except UnitFailedError as error:
            print(error)
    ray.shutdown()
    cluster.shutdown()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
