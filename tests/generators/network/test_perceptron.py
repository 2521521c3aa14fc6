"""The denoising network of coordinates: shapes, and what it depends on."""

import pytest
import torch

from prior_reinforce.generators.network.config import PerceptronSize
from prior_reinforce.generators.network.perceptron import ConditionalPerceptron
from prior_reinforce.generators.network.training import build

SIZE = PerceptronSize(members=3, width=16, depth=2, step_width=8)


def network(coordinates=5, k=2):
    return build(lambda: ConditionalPerceptron(coordinates, k, SIZE), seed=0).eval()


@pytest.mark.parametrize(("coordinates", "k"), [(1, 1), (5, 2), (15, 3)])
def test_as_many_coordinates_come_out(coordinates, k):
    inputs = torch.randn(4, coordinates, 1), torch.arange(4), torch.randn(4, k)
    assert network(coordinates, k)(*inputs).shape == (4, coordinates, 1)


@pytest.mark.parametrize("changed", [0, 1, 2])
def test_it_depends_on_coordinates_noise_level_and_condition(changed):
    inputs = [torch.randn(1, 5, 1), torch.tensor([3]), torch.randn(1, 2)]
    made = network()
    before = made(*inputs)
    inputs[changed] = inputs[changed] + 1
    assert (made(*inputs) - before).abs().max() > 1e-4


def test_a_sample_does_not_depend_on_its_batch():
    made, noisy, conditions = network(), torch.randn(6, 5, 1), torch.randn(6, 2)
    levels = torch.arange(6) * 10
    together = made(noisy, levels, conditions)
    alone = made(noisy[2:3], levels[2:3], conditions[2:3])
    torch.testing.assert_close(together[2:3], alone, atol=1e-6, rtol=0)


def test_each_member_predicts_in_training_and_their_mean_after_it():
    made, inputs = network(), (torch.randn(4, 5, 1), torch.arange(4), torch.randn(4, 2))
    mean = made(*inputs)
    of_members = made.train()(*inputs)
    assert of_members.shape == (3, 4, 5, 1)
    torch.testing.assert_close(of_members.mean(dim=0), mean)
    assert (of_members[0] - of_members[1]).abs().max() > 1e-2


def test_members_do_not_learn_from_one_another():
    """The gradient of one member's error leaves the others' layers alone."""
    made = network().train()
    made(torch.randn(4, 5, 1), torch.arange(4), torch.randn(4, 2))[1].square().sum().backward()
    for name, parameter in made.named_parameters():
        if not name.startswith("step_embedding"):
            changed = parameter.grad.flatten(1).abs().max(dim=1).values > 0
            assert changed.tolist() == [False, True, False], name
