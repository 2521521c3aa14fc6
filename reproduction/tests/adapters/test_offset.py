import numpy as np

from prior_reinforce.testing import synthetic_demonstrations
from reproduction.adapters.offset import MeanOffsetAdapter


def test_it_takes_off_the_mean_of_what_all_trials_were_off_by():
    adapter = MeanOffsetAdapter()
    adapter.start(synthetic_demonstrations())
    goal = np.array([0.2, 10.0])
    adapter.observe(goal, goal, np.array([0.04, -2.0]))
    adapter.observe(goal - [0.1, 0.0], goal, np.array([-0.08, 0.0]))  # 2 cm more than asked for
    np.testing.assert_allclose(adapter.propose(goal), goal - [0.03, -1.0])
