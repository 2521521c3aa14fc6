"""Films of a rollout: an mp4, and a strip of its key moments as one picture."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import imageio.v2 as imageio
import numpy as np
from matplotlib.figure import Figure

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.report.style import INK, drawing, new_figure, save_png

_THUMBNAIL_WIDTH = 320  # [pixels]; six of them fill a page at twice its resolution.
_COLUMNS = 3
_STILLNESS_SHARE = 0.25
# Ours: of the distance between two key moments, the share that mere time contributes; the rest is
# motion in the picture, so that a second of standing still takes one place in the strip, not three.


@dataclass(frozen=True)
class Film:
    """Where a film lies on disk."""

    video: Path
    """The mp4."""
    strip: Path
    """PNG of its key moments."""


def record_film(
    pictures: Iterable[np.ndarray], folder: Path, stem: str, *, fps: int = 30, moments: int = 6
) -> Film:
    """Write a film and its strip in one pass over the pictures.

    Nothing is left behind when `pictures` raises, for instance RenderingUnavailableError.

    Args:
        pictures: Each of shape (height, width, 3), dtype uint8, all of one size.
        folder: Where to write `<stem>.mp4` and `<stem>-film.png`; made if need be.
        stem: Beginning of the files' names.
        fps: Pictures a second.
        moments: Key moments in the strip.

    Raises:
        ConfigurationError: No pictures, or of wrong or different shape or type.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    thumbnails: list[np.ndarray] = []

    def watched() -> Iterator[np.ndarray]:
        for picture in pictures:
            yield picture
            thumbnails.append(_thumbnail(picture))

    video = write_film(watched(), folder / f"{stem}.mp4", fps=fps)
    strip = folder / f"{stem}-film.png"
    save_png(film_strip(thumbnails, moments, fps=fps), strip)
    return Film(video, strip)


def write_film(pictures: Iterable[np.ndarray], path: Path, *, fps: int = 30) -> Path:
    """Write an mp4 (H.264, 4:2:0) that any browser plays; the file appears only when complete.

    Args:
        pictures: Each of shape (height, width, 3), dtype uint8, all of one size.
        path: The file to write.
        fps: Pictures a second.

    Returns:
        The path.

    Raises:
        ConfigurationError: No pictures, or of wrong or different shape or type.
    """
    if fps < 1:
        raise ConfigurationError(f"fps must be at least 1 picture a second, got {fps}")
    path = Path(path)
    partial = path.with_name(f".{path.name}.partial.mp4")
    writer = None
    shape: tuple[int, ...] = ()
    try:
        for i, picture in enumerate(pictures):
            _check_picture(picture, i, shape)
            if writer is None:
                shape = picture.shape
                writer = imageio.get_writer(
                    partial,
                    format="FFMPEG",
                    mode="I",
                    fps=fps,
                    codec="libx264",
                    pixelformat="yuv420p",
                    macro_block_size=1,
                    ffmpeg_log_level="error",
                    output_params=["-crf", "23", "-movflags", "+faststart"],
                )
            # 4:2:0 colour needs even sizes: an odd last row or column is repeated.
            even = np.pad(picture, ((0, shape[0] % 2), (0, shape[1] % 2), (0, 0)), mode="edge")
            writer.append_data(even)
        if writer is None:
            raise ConfigurationError("a film needs at least one picture, got none")
        writer.close()
        writer = None
        os.replace(partial, path)
    finally:
        if writer is not None:
            writer.close()
        partial.unlink(missing_ok=True)
    return path


@drawing()
def film_strip(pictures: Sequence[np.ndarray], moments: int = 6, *, fps: int = 30) -> Figure:
    """Draw the key moments of a film in rows of three, each with its time.

    Args:
        pictures: All pictures of the film, each of shape (height, width, 3), dtype uint8.
        moments: Number of key moments; fewer pictures than that are all shown.
        fps: Pictures a second.

    Raises:
        ConfigurationError: No pictures, or of wrong or different shape or type.
    """
    if not pictures or moments < 1:
        raise ConfigurationError(
            f"a film strip needs pictures and moments, got {len(pictures)} and {moments}"
        )
    for i, picture in enumerate(pictures):
        _check_picture(picture, i, pictures[0].shape)
    chosen = key_moments(pictures, moments)
    height, width = pictures[0].shape[:2]
    columns = min(_COLUMNS, len(chosen))
    rows = -(-len(chosen) // columns)
    panel = 2.2  # [inch]
    figure = new_figure(panel * columns, panel * height / width * rows, laid_out=False)
    figure.subplots_adjust(0, 0, 1, 1, wspace=0.02, hspace=0.02 * width / height)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels:
        axes.set_axis_off()
    for axes, i in zip(panels, chosen, strict=False):
        axes.imshow(pictures[i], interpolation="lanczos", aspect="auto")
        axes.text(
            0.035,
            0.04,
            f"{i / fps:.2f} s",
            transform=axes.transAxes,
            fontsize=9,
            color=INK,
            bbox={"boxstyle": "round,pad=0.25", "facecolor": "white", "linewidth": 0},
        )
    return figure


def key_moments(pictures: Sequence[np.ndarray], moments: int) -> list[int]:
    """Choose pictures that are about equally far apart, counting motion more than time.

    Args:
        pictures: Each of shape (height, width, 3), dtype uint8.
        moments: How many to choose.

    Returns:
        Rising indices, the first and the last picture among them.
    """
    n = len(pictures)
    if n <= moments:
        return list(range(n))
    # A coarse raster is enough to see what moves.
    coarse = [picture[::8, ::8].astype(float) for picture in pictures]
    motion = np.array([np.abs(b - a).mean() for a, b in pairwise(coarse)])
    motion = motion / motion.sum() if motion.sum() > 0 else motion
    steps = (1 - _STILLNESS_SHARE) * motion + _STILLNESS_SHARE / (n - 1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.linspace(0.0, way[-1], moments)
    chosen = [int(np.abs(way - w).argmin()) for w in wanted]
    for i in range(1, moments):  # One jump of the picture must not be chosen twice.
        chosen[i] = max(chosen[i], chosen[i - 1] + 1)
    for i in range(moments - 1, -1, -1):
        chosen[i] = min(chosen[i], n - moments + i)
    return chosen


def _thumbnail(picture: np.ndarray) -> np.ndarray:
    """Shrink by a whole factor, averaging, to no less than the strip's width."""
    factor = max(1, picture.shape[1] // _THUMBNAIL_WIDTH)
    height, width = (side // factor * factor for side in picture.shape[:2])
    blocks = picture[:height, :width].reshape(height // factor, factor, width // factor, factor, 3)
    return np.asarray(blocks.mean(axis=(1, 3)).round(), dtype=np.uint8)


def _check_picture(picture: np.ndarray, i: int, shape: tuple[int, ...]) -> None:
    if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3:
        raise ConfigurationError(
            f"picture {i} of a film must be (height, width, 3) of uint8, got {picture.shape} of "
            f"{picture.dtype}"
        )
    if shape and picture.shape != shape:
        raise ConfigurationError(
            f"picture {i} of a film has shape {picture.shape}, the first has {shape}; all must "
            "be of one size"
        )
