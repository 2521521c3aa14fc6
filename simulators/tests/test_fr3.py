"""The simulated FR3 itself; what a client makes of it is in arm/executing/test_fr3."""

import subprocess
import sys

from simulators import served


def test_two_of_them_need_two_addresses():
    with served.fr3() as first:
        words = ["-m", "simulators", "fr3", "--host", first.host]
        again = subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=60)
    assert again.returncode == 2
    assert f"cannot serve on {first.host}" in again.stderr
    assert len(again.stderr.splitlines()) == 1


def test_it_ends_when_it_is_asked_to():
    with served.fr3() as program:
        program.program.terminate()
        assert program.program.wait(timeout=20) == 0
