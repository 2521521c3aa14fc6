"""Import torch with threads that sleep while they wait, and set their number.

OpenMP's threads spin by default: two of one training, beside other work, made it take over ten
times as long. The wait policy is read once, when torch is loaded, so it has to be set before.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from prior_reinforce.errors import ConfigurationError

_SPIN = "torch" in sys.modules and "OMP_WAIT_POLICY" not in os.environ
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import torch as torch  # noqa: E402
from torch import nn as nn  # noqa: E402


@contextmanager
def torch_threads(n: int) -> Iterator[None]:
    """Let torch compute on n threads inside the block.

    A result's last digits depend on n, since sums are split among threads; so it is set, not
    inherited from the caller. ConfigurationError if n is more than one, and torch was loaded before
    the wait policy was set.
    """
    if n > 1 and _SPIN:
        raise ConfigurationError(
            f"torch was imported before it was told that its threads sleep while they wait, so "
            f"{n} may take ten times as long as one: start Python with OMP_WAIT_POLICY=PASSIVE, "
            "or take threads=1"
        )
    before = torch.get_num_threads()
    torch.set_num_threads(n)
    try:
        # On CUDA, the same seed gives the same numbers only with deterministic kernels.
        with torch.backends.cudnn.flags(enabled=True, benchmark=False, deterministic=True):
            yield
    finally:
        torch.set_num_threads(before)
