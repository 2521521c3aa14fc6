import subprocess
import sys


def test_commands_start_without_torch():
    # Importing it takes longer than all that most commands do.
    loaded = "import sys, prior_reinforce.cli; print('torch' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", loaded], capture_output=True, text=True, check=True
    )
    assert done.stdout == "False\n"
