"""`learn`: the model and its record; remarks, and nothing where nothing is lost."""

from dataclasses import replace

import pytest

from prior_reinforce.commands.learning import Learn
from prior_reinforce.generators import GENERATORS, make_generator
from prior_reinforce.generators.timing.alignment import align
from prior_reinforce.simulation.tasks import make_task
from tests.arm.workspace.planar import events_in

TINY = "training_steps=1"
RECORDED = make_task("basketball-v1").demonstrations("A").without_symmetry()


def learn(choice, frames=140):
    """Learn from set A of which only so many frames were recorded."""
    cut = replace(RECORDED, plans=RECORDED.plans[:, :frames])
    return make_generator(choice).fit(cut, seed=0)


@pytest.mark.parametrize(
    ("generator", "frames"),
    [(f"diffusion,{TINY}", 80), ("interpolation", 140)],
    ids=["cut off in mid-swing", "rest to rest"],
)
def test_the_timing_that_was_chosen_is_told_in_a_line_and_kept(generator, frames):
    model = learn(generator, frames)
    assert model.remarks[0].startswith(
        "timing: when to start is learned separately from the motion"
    )
    assert [remark.partition(":")[0] for remark in model.remarks] == (
        ["timing", "network"] if "diffusion" in generator else ["timing"]
    )


@pytest.mark.parametrize(
    "generator", [f"diffusion,{TINY},timing=none", "interpolation,timing=none"]
)
def test_nothing_is_told_where_nothing_was_chosen(generator):
    model = learn(generator, frames=80)
    assert all(remark.startswith("network: ") for remark in model.remarks)


def test_by_default_the_generator_is_chosen_and_told():
    model = learn("auto", frames=80)
    assert "generator: closed form, since the demonstrations show one pattern" in model.remarks
    assert GENERATORS.name_of(model) == "auto"


def test_align_is_short_for_a_setting():
    assert Learn(align=True).choice == "interpolation,timing=align"
    assert Learn(generator="diffusion", align=True).choice == "diffusion,timing=align"
    aligned = align(RECORDED).demonstrations.plans
    assert learn(Learn(align=True).choice).generate(RECORDED.outcomes_seen).shape == aligned.shape


def test_another_generator_can_be_learned(run, folder):
    _, out, _ = run("learn", folder, "--generator", "interpolation,timing=align")
    assert "next: prior-reinforce goal" in out
    assert "interpolation" in run("status", folder)[1]
    before = events_in(folder)
    for args, remedy in (
        (("--generator", "spline"), "known are auto, diffusion"),
        (("--generator", "interpolation,training_steps=5"), "has no setting 'training_steps'"),
        (("--generator", "diffusion,noise_levels=0"), ">= 1 - at `$.noise_levels`"),
        (("--generator", "diffusion,steps=3"), "has no setting 'steps'"),
        (("--generator", "interpolation,timing=never"), "timing"),
        (("--generator", "interpolation", "--seed", "-1"), "--seed must be a whole number from 0"),
    ):
        status, _, err = run("learn", folder, *args)
        assert status == 2
        assert remedy in err
    assert events_in(folder) == before


def test_trials_of_an_earlier_model_are_said_to_teach_nothing_wherever_it_matters(run, folder):
    run("goal", folder, "0.9", "0.05")
    for _ in range(2):
        run("ask", folder)
        run("tell", folder, "5cm long, 2cm left")
    left_out = "2 trials of other models teach this one nothing"
    assert left_out not in run("learn", folder, "--generator", "interpolation")[1]  # the same
    outs = [run("learn", folder, "--generator", "interpolation,timing=none")[1]]
    outs += [run(*said)[1] for said in (("status", folder), ("ask", folder))]
    outs += [run("amend", folder, 1, "4cm long")[1]]
    for out in outs:
        assert left_out in out
    assert run("goal", folder, "0.9", "0.1")[0] == 2
    run("void", folder)
    run("goal", folder, "0.9", "0.1", "--memory", "goal")
    assert left_out not in run("status", folder)[1]
