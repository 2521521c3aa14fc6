"""What an import found, in about ten lines and one picture, for a person to agree with."""

from __future__ import annotations

import os
from dataclasses import dataclass


@dataclass(frozen=True)
class Preview:
    """The last look before demonstrations are used."""

    text: str
    """About ten lines: episodes, rate, trimming, resampling, outcomes, remarks."""
    remarks: tuple[str, ...]
    """What a person should look at: gaps, ends in mid-swing, messages skipped."""

    def draw(self, path: str | os.PathLike[str]) -> None:
        """Write the picture (PNG): every joint over time, and the outcomes with their hull."""
        raise NotImplementedError
