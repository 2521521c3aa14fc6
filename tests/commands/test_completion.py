"""Shell completion offers commands and options, and no pieces of help."""

import shutil
import subprocess

import pytest

from prior_reinforce.commands import COMMANDS

_TRY = """
{script}
COMP_WORDS=({words}); COMP_CWORD=$(({n} - 1))
_prior_reinforce
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


def offered(script, *words):
    quoted = " ".join(f"'{word}'" for word in words)
    text = _TRY.format(script=script, words=quoted, n=len(words))
    return subprocess.run(["bash", "-c", text], capture_output=True, text=True).stdout.split("\n")[
        :-1
    ]


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash to ask")
def test_bash_is_offered_commands_then_options(run):
    status, script, _ = run("completion", "bash")
    assert status == 0
    assert offered(script, "prior-reinforce", "st") == ["status"]
    assert set(offered(script, "prior-reinforce", "")) == {*COMMANDS, "--help", "--version"}
    assert offered(script, "prior-reinforce", "ask", "hoop", "--o") == ["--out"]
    assert {"--hit", "--miss", "--error"} < set(offered(script, "prior-reinforce", "tell", "--"))
    # Names of folders and files are the shell's own business.
    assert offered(script, "prior-reinforce", "status", "ho") == [""]
    assert "complete -o default" in script


def test_zsh_takes_the_same_and_fish_its_own(run):
    bash, zsh = run("completion", "bash")[1], run("completion", "zsh")[1]
    assert zsh == "autoload -U +X bashcompinit && bashcompinit\n" + bash
    fish = run("completion", "fish")[1].splitlines()
    assert len([line for line in fish if "__fish_use_subcommand" in line]) == len(COMMANDS)
    assert "complete -c prior-reinforce -n '__fish_seen_subcommand_from ask' -l out" in fish
    assert run("completion", "tcsh")[0] == 2
