"""Colours and files: told apart, readable, the same bytes each time, whole or not at all."""

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.layout_engine import ConstrainedLayoutEngine

from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.report.style import (
    HIT,
    calm_axes,
    draw_joint,
    drawing,
    lay_out,
    new_figure,
    save_figure,
    text_on,
    trial_colour,
)


def luminance(colour):
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def test_trials_go_from_light_to_dark_and_hits_are_green():
    light = [luminance(trial_colour(i, 5)) for i in range(5)]
    assert light == sorted(light, reverse=True)
    assert trial_colour(3, 5, hit=True) == HIT
    assert trial_colour(0, 1) == trial_colour(4, 5)


@pytest.mark.parametrize("colour", [trial_colour(i, 5) for i in range(5)] + [HIT, "#d55e00"])
def test_text_on_a_badge_has_the_contrast_of_large_text(colour):
    dark, light = sorted([luminance(colour), luminance(text_on(colour))])
    assert (light + 0.05) / (dark + 0.05) >= 3.0  # WCAG 2.2, 1.4.3, large text


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_pictures_are_the_same_bytes_whatever_matplotlib_is_set_to(kind, tmp_path):
    @drawing()
    def draw():
        figure = new_figure(2, 1)
        axes = figure.subplots()
        calm_axes(axes)
        axes.set_title("dollars: $5 and $6")
        return figure

    first = save_figure(draw(), tmp_path / "new" / f"first.{kind}")
    with matplotlib.rc_context({"font.size": 30, "text.color": "red", "text.usetex": True}):
        second = save_figure(draw(), tmp_path / f"second.{kind}")
        assert matplotlib.rcParams["font.size"] == 30
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_pictures_are_the_same_bytes_whatever_the_last_digit_of_their_layout(kind, tmp_path):
    class Rounds(ConstrainedLayoutEngine):
        def execute(self, fig):
            super().execute(fig)
            for axes in fig.axes:
                axes._set_position(np.array(axes.get_position(original=True).bounds) * (1 + 4e-16))

    @drawing()
    def draw(engine):
        figure = new_figure(2, 1)
        figure.set_layout_engine(engine)
        for axes in figure.subplots(1, 2):
            axes.plot([0, 1], [1, 0])
            axes.set_aspect("equal")
        return figure

    exact = save_figure(draw(ConstrainedLayoutEngine()), tmp_path / f"exact.{kind}")
    rounded = save_figure(draw(Rounds()), tmp_path / f"rounded.{kind}")
    assert exact.read_bytes() == rounded.read_bytes()


def test_motions_of_other_lengths_are_drawn_over_one_joint_in_their_own_styles():
    axes = new_figure(2, 2).subplots()
    form = PlanFormat(("shoulder", "lift"), ("rad", "m"), 0.1)
    motions = [
        (np.array([0.0, 1.0]), np.array([[0.0, 3.0], [0.0, 4.0]]), {"linewidth": 1}),
        (np.array([0.0, 0.5, 1.0]), np.array([[0.0, 5.0]] * 3), {"linewidth": 2}),
    ]
    draw_joint(axes, form, 1, motions, ", twice")
    assert axes.get_title() == "lift [m], twice"
    drawn = [(line.get_ydata().tolist(), line.get_linewidth()) for line in axes.lines]
    assert drawn == [([3.0, 4.0], 1), ([5.0] * 3, 2)]


def test_a_picture_that_cannot_be_drawn_leaves_the_one_before(tmp_path, monkeypatch):
    path, figure = tmp_path / "picture.png", new_figure(2, 1)
    figure.subplots()
    path.write_bytes(b"before")

    def fail(to, **_):
        to.write_bytes(b"half a pic")
        raise ValueError("cannot be drawn")

    monkeypatch.setattr(figure, "savefig", fail)
    with pytest.raises(ValueError, match="cannot be drawn"):
        save_figure(figure, path)
    assert path.read_bytes() == b"before"
    assert [p.name for p in tmp_path.iterdir()] == ["picture.png"]


@pytest.mark.parametrize("theirs", [{}, {"figure.autolayout": True}])
def test_a_figure_is_arranged_as_when_it_is_drawn_and_only_once(theirs, monkeypatch):
    for name, value in theirs.items():
        monkeypatch.setitem(matplotlib.rcParams, name, value)
    once, drawn = new_figure(4, 3), new_figure(4, 3)
    for figure in (once, drawn):
        figure.subplots(1, 2)[0].set_ylabel("where it lands [cm]")
    lay_out(once)
    drawn.draw_without_rendering()
    for a, b in zip(once.axes, drawn.axes, strict=True):
        assert a.get_position().bounds == pytest.approx(b.get_position().bounds)
    before = once.axes[0].get_position().bounds
    once.axes[0].set_ylabel("two\nlines")
    once.draw_without_rendering()
    assert once.axes[0].get_position().bounds == before
