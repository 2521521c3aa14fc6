"""Every set that is shipped can be made again, to the last bit."""

import numpy as np
import pytest

from demonstrations import basketball, curling, curling_round, fishing, so101
from prior_reinforce.lab.tasks import make_task

MAKING = {
    "basketball-v1": basketball.make,
    "basketball-fr3": lambda name: basketball.make(name, task=make_task("basketball-fr3")),
    "curling": curling.make,
    "curling-round": curling_round.make,
    "fishing": fishing.make,
    "so101": so101.make,
}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "make"), MAKING.items(), ids=MAKING)
def test_shipped_sets_are_made_again_bit_for_bit(name, make):
    task = make_task(name)
    for which in task.demonstration_sets:
        made, shipped = make(which), task.demonstrations(which)
        np.testing.assert_array_equal(made.plans, shipped.plans)
        np.testing.assert_array_equal(made.outcomes_seen, shipped.outcomes_seen)
