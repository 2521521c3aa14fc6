"""`python -m prior_reinforce`: the `prior-reinforce` command."""

import sys

from prior_reinforce.cli import main

sys.exit(main())
