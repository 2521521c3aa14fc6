"""Shell completion: commands first, then the options of the command; else files, as ever."""

from __future__ import annotations

import io
import pkgutil
import re
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from prior_reinforce.commands import COMMANDS, GROUPS

_BASH = """\
_prior_reinforce() {{
  local words=""
  if [ "$COMP_CWORD" -eq 1 ]; then
    words="{commands} --help --version"
  elif [ "${{COMP_WORDS[COMP_CWORD]:0:1}}" = "-" ]; then
    case "${{COMP_WORDS[1]}}" in
{cases}
    esac
  fi
  COMPREPLY=($(compgen -W "$words" -- "${{COMP_WORDS[COMP_CWORD]}}"))
}}
complete -o default -F _prior_reinforce prior-reinforce
"""
_FISH = "complete -c prior-reinforce -n"


@dataclass(frozen=True)
class Completion:
    """Print what lets a shell complete commands and options.

    For example:
        echo 'eval "$(prior-reinforce completion bash)"' >> ~/.bashrc
        prior-reinforce completion fish > ~/.config/fish/completions/prior-reinforce.fish
    """

    shell: Annotated[Literal["bash", "zsh", "fish"], tyro.conf.Positional]
    """The shell."""

    def run(self) -> None:
        """Print it."""
        summaries = {name: what for group in GROUPS.values() for name, (_, what) in group.items()}
        options = {name: _options(target) for name, target in COMMANDS.items()}
        if self.shell == "fish":
            for name, what in summaries.items():
                print(f"{_FISH} __fish_use_subcommand -fa {name} -d '{what}'")
                for option in options[name]:
                    seen = f"'__fish_seen_subcommand_from {name}'"
                    print(f"{_FISH} {seen} -l {option.removeprefix('--')}")
            return
        if self.shell == "zsh":
            print("autoload -U +X bashcompinit && bashcompinit")
        cases = [f'      {name}) words="{" ".join(each)}" ;;' for name, each in options.items()]
        print(_BASH.format(commands=" ".join(COMMANDS), cases="\n".join(cases)), end="")


def _options(target: str) -> list[str]:
    """Long options of a command; none where a library that it needs is not installed."""
    shown = io.StringIO()
    with suppress(ImportError, SystemExit), redirect_stdout(shown):
        marks = (tyro.conf.DisallowNone, tyro.conf.FlagCreatePairsOff)
        tyro.cli(pkgutil.resolve_name(target), args=["--help"], config=marks)
    return re.findall(r"^\W*(?:-h, )?(--[a-z][\w.-]*)", shown.getvalue(), re.MULTILINE)
