"""How far one `ask` goes through the program: counted in files and functions, not in seconds."""

import sys
from pathlib import Path

import prior_reinforce
from prior_reinforce.arm.workspace.journal import Journal

_ROOT = Path(prior_reinforce.__file__).parent
_ROOMS = ("arm", "session", "commands", "cli.py")
"""What an `ask` itself is; the method behind it (adapters, generators, plans) is not counted."""


def test_an_ask_passes_through_few_files_and_functions(run, folder, monkeypatch):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)  # what is imported once is no part of the way
    run("tell", folder, "5cm long")
    walked, folds = set(), []
    state = Journal.state
    monkeypatch.setattr(Journal, "state", lambda log: folds.append(log) or state(log))

    def called(frame, event, _):
        path = Path(frame.f_code.co_filename)
        if event == "call" and path.is_relative_to(_ROOT):
            place = path.relative_to(_ROOT)
            if place.parts[0] in _ROOMS:
                walked.add((str(place), frame.f_code.co_firstlineno))

    sys.setprofile(called)
    try:
        status, _, err = run("ask", folder)
    finally:
        sys.setprofile(None)
    assert (status, err) == (0, "")
    assert len({file for file, _ in walked}) <= 30
    assert len(walked) <= 250
    assert len(folds) <= 10
