"""How many cores torch computes on, changed for a while and put back."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager


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


def available_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
