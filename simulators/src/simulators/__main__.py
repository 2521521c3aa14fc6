"""`python -m simulators fr3|so101|ur`."""

import sys

from prior_reinforce.cli import read, run
from simulators.command import Simulate


def main(args: list[str] | None = None) -> int:
    """Serve an arm; the exit status, as of `prior_reinforce.cli.run`."""
    return run(lambda given: read(Simulate, "python -m simulators", given), args)


if __name__ == "__main__":
    sys.exit(main())
