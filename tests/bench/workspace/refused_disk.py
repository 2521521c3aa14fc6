"""One command on a workspace whose disk refuses to write.

    python tests/bench/workspace/refused_disk.py read-only|full COMMAND ...

A program of its own: a limit on written files, and giving up root, cannot be undone.
"""

import contextlib
import io
import os
import resource
import sys

from prior_reinforce.cli import main

NOBODY = 65534

if __name__ == "__main__":
    if sys.argv[1] == "full":
        # Writing beyond the limit fails as a full disk does, for root as well.
        resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))
    elif os.geteuid() == 0:
        # While root may still read an interpreter that lies in its home.
        with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
            main([sys.argv[2], "--help"])
        os.setuid(NOBODY)
    sys.exit(main(sys.argv[2:]))
