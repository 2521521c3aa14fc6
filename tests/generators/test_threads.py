"""Threads of torch: they sleep while they wait, and their number is put back."""

import os
import subprocess
import sys

import torch

from prior_reinforce.generators.threads import torch_threads


def test_the_number_holds_inside_and_is_put_back():
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
        "import prior_reinforce.generators.denoiser\n"
        "assert 'torch' in sys.modules and os.environ['OMP_WAIT_POLICY'] == 'PASSIVE'\n"
    )
    environment = {k: v for k, v in os.environ.items() if k != "OMP_WAIT_POLICY"}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
