"""Threads of torch: they sleep while they wait, and their number is put back."""

import os
import subprocess
import sys

import pytest
import torch

from prior_reinforce.generators.network import threads
from prior_reinforce.generators.network.threads import torch_threads


def test_the_number_holds_inside_and_is_put_back(monkeypatch):
    monkeypatch.setattr(threads, "_SPIN", False)  # pytest imports torch first
    before = torch.get_num_threads()
    with torch_threads(before + 1):
        assert torch.get_num_threads() == before + 1
    assert torch.get_num_threads() == before


def test_threads_sleep_from_the_first_import_of_torch_on():
    code = (
        "import sys, os\n"
        "from prior_reinforce.generators import make_generator\n"
        "make_generator('diffusion')\n"
        "assert 'torch' not in sys.modules and 'OMP_WAIT_POLICY' not in os.environ\n"
        "import prior_reinforce.generators.network.denoiser\n"
        "assert 'torch' in sys.modules and os.environ['OMP_WAIT_POLICY'] == 'PASSIVE'\n"
    )
    environment = {k: v for k, v in os.environ.items() if k != "OMP_WAIT_POLICY"}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)


@pytest.mark.parametrize(
    ("first", "policy", "said"),
    [
        ("import torch", None, "OMP_WAIT_POLICY=PASSIVE"),
        ("import prior_reinforce, torch", None, "OMP_WAIT_POLICY=PASSIVE"),
        ("import torch", "PASSIVE", "2"),
        ("import torch", "ACTIVE", "2"),  # whoever says so means it
        ("import prior_reinforce", None, "2"),
    ],
)
def test_two_threads_that_would_spin_are_refused_whatever_was_imported_first(first, policy, said):
    code = (
        f"{first}\n"
        "from prior_reinforce.generators.network.threads import torch, torch_threads\n"
        "with torch_threads(1): assert torch.get_num_threads() == 1\n"
        "try:\n"
        "    with torch_threads(2): print(torch.get_num_threads())\n"
        "except ValueError as error: print(error)\n"
    )
    environment = {k: v for k, v in os.environ.items() if k != "OMP_WAIT_POLICY"}
    environment |= {"OMP_WAIT_POLICY": policy} if policy else {}
    program = [sys.executable, "-c", code]
    run = subprocess.run(program, check=True, env=environment, capture_output=True, text=True)
    assert said in run.stdout
