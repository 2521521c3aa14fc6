"""Size and shapes of the network, and that time is treated alike everywhere."""

import pytest
import torch

from prior_reinforce.generators.network.config import UNetSize
from prior_reinforce.generators.network.unet import ConditionalUNet

TINY = UNetSize(widths=(8, 16), groups=2, step_width=8, condition_width=8)


def network(channels: int = 3, size: UNetSize = TINY) -> ConditionalUNet:
    torch.manual_seed(0)
    return ConditionalUNet(channels, 2, size).eval()


def inputs(n: int, channels: int, length: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    rng = torch.Generator().manual_seed(0)
    noisy = torch.randn((n, channels, length), generator=rng)
    return noisy, torch.arange(n), torch.randn((n, 2), generator=rng)


def test_reference_size_has_the_parameters_of_the_published_network():
    # 68.9 million for 7 actions and an embedded condition of 256, computed from the published
    # code; counted layer by layer here, then the two-layer MLP on the condition, which is ours.
    def block(n_in, n_out):
        convolutions = (5 * n_in + 1) * n_out + (5 * n_out + 1) * n_out
        norms = 4 * n_out
        film = (512 + 1) * 2 * n_out
        return convolutions + norms + film + ((n_in + 1) * n_out if n_in != n_out else 0)

    def pair(n_in, n_out):
        return block(n_in, n_out) + block(n_out, n_out)

    down = pair(7, 256) + pair(256, 512) + pair(512, 1024)
    shrink = sum((3 * n + 1) * n for n in (256, 512))
    up = pair(2048, 512) + pair(1024, 256)
    grow = sum((4 * n + 1) * n for n in (512, 256))
    head = (5 * 256 + 1) * 256 + 2 * 256 + (256 + 1) * 7
    step = (256 + 1) * 1024 + (1024 + 1) * 256
    reference = down + shrink + pair(1024, 1024) + up + grow + head + step
    assert round(reference / 1e6, 1) == 68.9
    condition = (2 + 1) * 256 + (256 + 1) * 256
    with torch.device("meta"):
        built = ConditionalUNet(7, 2, UNetSize())
    assert sum(p.numel() for p in built.parameters()) == reference + condition


@pytest.mark.parametrize("length", [4, 36, 144])
@pytest.mark.parametrize("n", [1, 5])
def test_output_has_the_shape_of_the_input_for_any_length(n, length):
    noisy, steps, conditions = inputs(n, 3, length)
    assert network()(noisy, steps, conditions).shape == noisy.shape


def test_one_width_needs_no_particular_length():
    size = UNetSize(widths=(8,), groups=2, step_width=8, condition_width=8)
    assert size.length_multiple == 1
    noisy, steps, conditions = inputs(2, 3, 5)
    assert network(size=size)(noisy, steps, conditions).shape == noisy.shape


def test_step_and_condition_reach_the_output():
    noisy, steps, conditions = inputs(2, 3, 8)
    net = network()
    with torch.no_grad():
        before = net(noisy, steps, conditions)
        assert not torch.allclose(before, net(noisy, steps + 30, conditions), atol=1e-4)
        assert not torch.allclose(before, net(noisy, steps, conditions + 0.5), atol=1e-4)


def test_a_sample_does_not_depend_on_the_rest_of_the_batch():
    noisy, steps, conditions = inputs(5, 3, 8)
    net = network()
    with torch.no_grad():
        together = net(noisy, steps, conditions)
        alone = net(noisy[2:3], steps[2:3], conditions[2:3])
    torch.testing.assert_close(together[2:3], alone, atol=1e-5, rtol=0)


@pytest.mark.slow
def test_a_shift_in_time_shifts_the_output():
    # By a multiple of the coarsest level's stride and far from the ends; what is left comes from
    # the ends, through the group normalisation's statistics.
    noisy = torch.zeros((1, 3, 128))
    noisy[:, :, 60:68] = torch.randn((1, 3, 8), generator=torch.Generator().manual_seed(0))
    _, steps, conditions = inputs(1, 3, 8)
    net = network()
    with torch.no_grad():
        here = net(noisy, steps, conditions)[..., 40:90]
        later = net(noisy.roll(4, dims=-1), steps, conditions)[..., 44:94]
    assert here.std() > 0.05
    torch.testing.assert_close(here, later, atol=1e-3, rtol=0)


def test_step_embedding_tells_all_levels_apart():
    net = network()
    with torch.no_grad():
        embedded = net.step_embedding(torch.arange(100))
    assert torch.pdist(embedded).min() > 1e-5
