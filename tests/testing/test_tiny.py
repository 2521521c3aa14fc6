import pytest

from prior_reinforce.generators import GENERATORS, make_generator
from prior_reinforce.testing import TINY, synthetic_demonstrations, tiny_networks


@pytest.mark.parametrize("name", TINY)
def test_a_network_chosen_by_name_is_tiny_meanwhile_and_full_size_afterwards(name):
    before = dict(GENERATORS.members)
    with tiny_networks():
        heard = []
        make_generator(name).fit(synthetic_demonstrations(2), seed=0, progress=heard.append)
        assert heard[-1].n_steps == TINY[name]["training_steps"]
    assert GENERATORS.members == before
