"""The Compare panel: what it proposes and refuses without OpenGL, and a real window."""

from __future__ import annotations

import pytest

from tests.ui.display import check_played, needs_display, play
from volviz.lab import vary
from volviz.model.surface_look import SceneSurface
from volviz.resolve import known_statistics
from volviz.ui.facts import Facts
from volviz.ui.panels import compare
from volviz.ui.trials import MOST, Trial, Trials


def offered(scene):
    """Everything the panel's list has, but knobs with only one choice."""
    knobs = {n: p.knob for n, p in vary.places(scene).items()}
    return [compare.PRESET, *(n for n, k in knobs.items() if len(k.choices) != 1)]


def test_for_every_knob_values_are_proposed_that_it_takes(scene):
    scene = scene.with_surfaces([SceneSurface.at(40.0)])
    facts = Facts(statistics=known_statistics(scene.volume))
    names = offered(scene)
    assert len(names) > 15
    for name in names:
        text = compare.proposal(scene, name, facts)
        axis = vary.axis(f"{name}={text}", scene)
        assert 2 <= len(axis.values) <= MOST, name
        assert len(set(axis.values)) == len(axis.values), name
        made = vary.variants(scene, [axis])
        assert len({v.label for v in made}) == len(made), name


def test_every_knob_can_be_chosen_and_tried(stage, scene):
    one = stage(compare.panel, scene)
    state = one.local.of(compare.State)
    for name in offered(scene):
        state.name = name
        one.frame(2)
        one.click("compare.run")
        trials = one.local.of(Trials)
        assert [*trials.all[0].variant.changed] == [name]
        assert all(f"compare.{i}" in one.seen.where for i in range(len(trials.all)))
    assert one.scene is scene, "trying changes nothing"


def test_a_click_takes_a_variant_over(stage, scene):
    one = stage(compare.panel, scene)
    state = one.local.of(compare.State)
    state.name = "raycast.shading"
    one.frame(2)
    one.click("compare.run")
    one.click("compare.1")
    assert one.scene == scene.with_knobs(shading="phong")
    assert len(one.history.past) == 1
    one.click("compare.1")
    assert len(one.history.past) == 1, "it has that already"
    one.click("compare.2")
    assert one.scene == scene.with_knobs(shading="blinn-phong")


@pytest.mark.parametrize(
    ("text", "starts"),
    [
        ("none, phong", True),
        ("none", True),
        ("all", True),
        ("none,", True),
        ("fong", False),
        ("none,,phong", False),
        ("", False),
    ],
)
def test_only_what_can_be_drawn_starts(stage, scene, text, starts):
    one = stage(compare.panel, scene)
    state = one.local.of(compare.State)
    state.name = "raycast.shading"
    one.frame(2)
    state.text = text
    one.frame()
    one.click("compare.run")
    assert bool(one.local.of(Trials).all) is starts


def test_too_many_are_refused(stage, scene):
    one = stage(compare.panel, scene)
    state = one.local.of(compare.State)
    state.name = "raycast.seed"
    one.frame(2)
    state.text = ",".join(map(str, range(MOST + 1)))
    one.frame()
    one.click("compare.run")
    assert not one.local.of(Trials).all
    state.text = ",".join(map(str, range(MOST)))
    one.frame()
    one.click("compare.run")
    assert len(one.local.of(Trials).all) == MOST


def test_numbers_are_told_as_they_come(scene):
    (variant,) = vary.variants(scene, [vary.axis("step=1", scene)])
    trial = Trial(variant)
    assert compare._numbers(trial) == ""
    trial.ms = 12.345
    assert compare._numbers(trial) == "12.3 ms"
    trial.rmse, trial.largest = 1.239, 7
    assert compare._numbers(trial) == "12.3 ms · Δ 1.24"
    trial.ms = 1234.0
    assert compare._numbers(trial) == "1.23 s · Δ 1.24"
    assert "RMSE 1.24, at most 7" in compare._about(trial)


@needs_display
@pytest.mark.parametrize("name", ["panel", "wipe", "surfaces_of_a_sample"])
def test_window(name, tmp_path):
    check_played(play("scripts_compare", name, tmp_path))
