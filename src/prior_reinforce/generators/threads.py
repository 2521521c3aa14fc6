"""How many cores torch computes on, changed for a while and put back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from prior_reinforce.cores import available_cores


@contextmanager
def torch_threads(n: int | None) -> Iterator[None]:
    """Let torch compute on n threads inside the block; as many as there are cores where None.

    The number is part of a result's last digits: sums are split among threads. So it is set rather
    than inherited from whoever calls.
    """
    import torch  # here, because it takes seconds and most commands do without

    before = torch.get_num_threads()
    torch.set_num_threads(n or available_cores())
    try:
        # On CUDA, the same seed gives the same numbers only with deterministic kernels.
        with torch.backends.cudnn.flags(enabled=True, benchmark=False, deterministic=True):
            yield
    finally:
        torch.set_num_threads(before)
