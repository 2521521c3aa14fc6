"""The progress line of a training."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from prior_reinforce.generators.base import FitProgress


@contextmanager
def fit_progress(console: Console) -> Iterator[Callable[[FitProgress], None]]:
    """Show a bar with loss and time left while a generator is fitted."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.fields[detail]}"),
    )
    with Progress(*columns, console=console) as progress:
        line = progress.add_task("learning the motion", total=None, detail="")

        def show(state: FitProgress) -> None:
            detail = f"loss {state.loss:.4f}, {state.seconds_left:.0f} s left"
            progress.update(line, total=state.n_steps, completed=state.step, detail=detail)

        yield show
        progress.update(line, detail="done")
