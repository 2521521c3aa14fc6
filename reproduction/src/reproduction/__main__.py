"""`python -m reproduction RECIPE`, or `verify`."""

import sys

from prior_reinforce.cli import read, run
from reproduction.command import Reproduce
from reproduction.verify import Verify


def main(args: list[str] | None = None) -> int:
    """Make evidence; the exit status, as of `prior_reinforce.cli.run`."""

    def parse(given: list[str]) -> Reproduce | Verify:
        if given[:1] == ["verify"]:
            return read(Verify, "python -m reproduction verify", given[1:])
        return read(Reproduce, "python -m reproduction", given)

    return run(parse, args)


if __name__ == "__main__":
    sys.exit(main())
