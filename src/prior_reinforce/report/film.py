"""Films of a rollout: an mp4, and a strip of its key moments as one picture."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import chain, pairwise
from pathlib import Path
from subprocess import PIPE, Popen
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import UInt8

from prior_reinforce.errors import ConfigurationError, RenderingUnavailableError
from prior_reinforce.files import in_place
from prior_reinforce.report.record import Film

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_Picture = UInt8[np.ndarray, "height width 3"]
_Thumbnail = UInt8[np.ndarray, "rows columns 3"]
_THUMBNAIL_WIDTH = 320  # [pixels]; six of them fill a page at twice its resolution.
_COLUMNS = 3
_PANEL_WIDTH = 2.2  # [inch]
_STILLNESS_SHARE = 0.25
# Ours: of the distance between two key moments, the share that mere time contributes; the rest is
# motion in the picture, so that a second of standing still takes one place in the strip, not three.


def record_film(
    pictures: Iterable[np.ndarray], folder: Path, stem: str, *, fps: int = 30, moments: int = 6
) -> Film:
    """Write `<stem>.mp4` and, as one picture, its key moments to `<stem>-film.png`.

    The pictures are (height, width, 3) of uint8, all of one size, and taken one by one, `fps` a
    second; nothing is left behind when they raise. ConfigurationError for none, or others;
    RenderingUnavailableError, with what ffmpeg said, if that failed.
    """
    from prior_reinforce.report.style import save_figure

    thumbnails: list[_Thumbnail] = []

    def watched() -> Iterator[_Picture]:
        for picture in _checked(pictures):
            yield picture
            thumbnails.append(_thumbnail(picture))

    video = _write_video(watched(), folder / f"{stem}.mp4", fps)
    strip = _draw_strip(thumbnails, moments, fps)
    return Film(video, save_figure(strip, folder / f"{stem}-film.png"))


def key_moments(pictures: Sequence[_Picture], moments: int) -> list[int]:
    """Indices of pictures about equally far apart, the first and the last among them.

    Motion counts more than time.
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
    nearest = np.abs(way[:, None] - np.linspace(0.0, way[-1], moments)).argmin(axis=0)
    order = np.arange(moments)  # one jump of the picture must not be chosen twice
    chosen = np.maximum.accumulate(nearest - order) + order
    return np.minimum(chosen, n - moments + order).tolist()


def _write_video(pictures: Iterator[_Picture], path: Path, fps: int) -> Path:
    """Write an mp4 (H.264, 4:2:0) that any browser plays, whole or not at all."""
    from imageio_ffmpeg import get_ffmpeg_exe

    first = next(pictures)
    height, width = first.shape[:2]
    # 4:2:0 colour needs even sizes: an odd last row or column is repeated.
    even = ((0, height % 2), (0, width % 2), (0, 0))
    size = f"{width + width % 2}x{height + height % 2}"
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", str(fps), "-i", "-"]
    film = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "23", "-movflags", "+faststart"]
    with in_place(path) as unfinished:
        command = [get_ffmpeg_exe(), "-y", "-loglevel", "error", *raw, *film, str(unfinished)]
        with Popen(command, stdin=PIPE, stderr=PIPE) as ffmpeg:
            assert ffmpeg.stdin is not None
            with suppress(BrokenPipeError):  # It has ended, and says below why.
                for picture in chain([first], pictures):
                    ffmpeg.stdin.write(np.pad(picture, even, "edge").tobytes())
            _, said = ffmpeg.communicate()
        if ffmpeg.returncode:
            reason = said.decode(errors="replace").strip() or f"status {ffmpeg.returncode}"
            raise RenderingUnavailableError(f"ffmpeg made no film: {reason}")
    return path


def _draw_strip(film: Sequence[_Picture], moments: int, fps: int) -> Figure:
    """Draw key moments in rows of three, each with its time."""
    from prior_reinforce.report.style import INK, drawing, new_figure

    chosen = key_moments(film, moments)
    height, width = film[0].shape[:2]
    columns = min(_COLUMNS, len(chosen))
    rows = -(-len(chosen) // columns)
    size = _PANEL_WIDTH * columns, _PANEL_WIDTH * height / width * rows
    with drawing():
        figure = new_figure(*size, laid_out=False)
        figure.subplots_adjust(0, 0, 1, 1, wspace=0.02, hspace=0.02 * width / height)
        for k, i in enumerate(chosen, start=1):
            axes = figure.add_subplot(rows, columns, k)
            axes.set_axis_off()
            axes.imshow(film[i], interpolation="lanczos", aspect="auto")
            box = {"boxstyle": "round,pad=0.25", "facecolor": "white", "linewidth": 0}
            time = f"{i / fps:.2f} s"
            axes.text(0.035, 0.04, time, transform=axes.transAxes, fontsize=9, color=INK, bbox=box)
    return figure


def _thumbnail(picture: _Picture) -> _Thumbnail:
    """Shrink by a whole factor, averaging, to no less than the strip's width."""
    factor = max(1, picture.shape[1] // _THUMBNAIL_WIDTH)
    height, width = (side // factor * factor for side in picture.shape[:2])
    blocks = picture[:height, :width].reshape(height // factor, factor, width // factor, factor, 3)
    return np.asarray(blocks.mean(axis=(1, 3)).round(), dtype=np.uint8)


def _checked(pictures: Iterable[np.ndarray]) -> Iterator[_Picture]:
    """The pictures of a film, at least one, each checked as it comes."""
    shape: tuple[int, ...] = ()
    for i, picture in enumerate(pictures):
        colours = picture.ndim == 3 and picture.shape[2] == 3 and picture.dtype == np.uint8
        if not colours or picture.shape != (shape or picture.shape):
            raise ConfigurationError(
                f"picture {i} of a film must be {shape or '(height, width, 3)'} of uint8, got "
                f"{picture.shape} of {picture.dtype}; all must be of one size"
            )
        shape = picture.shape
        yield picture
    if not shape:
        raise ConfigurationError("a film needs at least one picture, got none")
