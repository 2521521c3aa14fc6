"""Mixtures that are learned, and DDIM that keeps to one way."""

import pytest
import torch

from prior_reinforce.generators import DiffusionConfig
from prior_reinforce.generators.network.denoiser import sample
from reproduction.generators.mixtures import ddim, mixed, nearest
from tests.generators.network.test_denoiser import gaussian


def test_mixtures_are_of_those_that_move_alike_and_their_outcomes_are_mixed_the_same_way():
    codes = torch.tensor([[0.0], [0.1], [5.0], [5.2]])[:, :, None]
    conditions = 2 * codes[:, :, 0] + 1  # so a mixture has the mixture of conditions
    alike = nearest(codes, 2)[[0, 3]]
    assert alike.tolist() == [[0, 1], [3, 2]]
    alike = alike.repeat(200, 1)
    clean, given = mixed(codes, conditions, alike, torch.Generator().manual_seed(0))
    torch.testing.assert_close(given, 2 * clean[:, :, 0] + 1)
    low, high = clean[::2, 0, 0], clean[1::2, 0, 0]
    assert low.min() >= -0.06
    assert low.max() <= 0.16  # of the two near 0, a quarter beyond them at most
    assert high.min() > 4.9
    assert (low < 0).any()
    assert 5 <= (low == 0).sum() <= 50  # demonstrations as they are


@pytest.mark.parametrize("shared", [True, False])
def test_a_code_depends_on_its_condition_alone(shared):
    config = DiffusionConfig(prediction="sample", margin=1.0, shared_noise=shared)
    conditions = torch.tensor([[0.1], [0.5], [-0.7]])
    together = sample(gaussian(0.01), conditions, (1, 4), config, seed=0, sampler=ddim)
    alone = sample(gaussian(0.01), conditions[1:2], (1, 4), config, seed=0, sampler=ddim)
    torch.testing.assert_close(together[1:2], alone, atol=1e-6, rtol=0)
    torch.testing.assert_close(together, conditions[:, :, None].expand(3, 1, 4), atol=0.03, rtol=0)
