"""One command on a workspace whose disk refuses to write.

    python tests/attacks/refused_disk.py read-only|full COMMAND ...

A program of its own: a limit on written files, and giving up root's rights, cannot be undone.
"""

import ctypes
import os
import resource
import sys

from prior_reinforce.cli import main

PR_CAPBSET_READ, PR_CAPBSET_DROP = 23, 24
CAP_DAC_OVERRIDE = 1
"""Root's right to write where permissions forbid it; it stays root, and reads what is its own."""

if __name__ == "__main__":
    if sys.argv[1] == "full":
        # Writing beyond the limit fails as a full disk does, for root as well.
        resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))
    elif os.geteuid() == 0:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.prctl(PR_CAPBSET_READ, CAP_DAC_OVERRIDE):
            assert libc.prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE) == 0, ctypes.get_errno()
            os.execv(sys.executable, [sys.executable, *sys.argv])
    sys.exit(main(sys.argv[2:]))
