import numpy as np

from prior_reinforce.adapters.memory import Memory

DEMONSTRATIONS = np.array([[0.0, 1.0], [2.0, 3.0]])


def test_starts_with_conditions_equal_to_outcomes():
    memory = Memory(DEMONSTRATIONS, size=2)
    np.testing.assert_array_equal(memory.conditions, DEMONSTRATIONS)
    np.testing.assert_array_equal(memory.outcomes_seen, DEMONSTRATIONS)
    assert (memory.n_demonstrations, memory.n_trials) == (2, 0)


def test_forgets_the_oldest_trial_and_never_a_demonstration():
    memory = Memory(DEMONSTRATIONS, size=2)
    for number in (10.0, 20.0, 30.0):
        memory.add(np.full(2, number), np.full(2, number + 1.0))
    np.testing.assert_array_equal(memory.conditions[2:], [[20.0, 20.0], [30.0, 30.0]])
    np.testing.assert_array_equal(memory.outcomes_seen[2:], [[21.0, 21.0], [31.0, 31.0]])
    np.testing.assert_array_equal(memory.conditions[:2], DEMONSTRATIONS)
    assert memory.n_trials == 2


def test_copies_what_it_is_given():
    demonstrations, condition = DEMONSTRATIONS.copy(), np.ones(2)
    memory = Memory(demonstrations, size=None)
    memory.add(condition, condition)
    demonstrations[:], condition[:] = -1.0, -1.0
    np.testing.assert_array_equal(memory.conditions, [*DEMONSTRATIONS, [1.0, 1.0]])
