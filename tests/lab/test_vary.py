"""What can be varied, how it is written, and what is told where it is wrong. No OpenGL."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest

import volviz
from volviz.errors import LimitError, UsageError
from volviz.lab import vary
from volviz.model.knobs import AS_SCENE, knobs_of
from volviz.model.scene import Light
from volviz.model.surface_look import SceneSurface
from volviz.model.views import volume_camera


@pytest.fixture(scope="module")
def scene():
    z, y, x = np.mgrid[-8:8, -8:8, -8:8]
    values = (10 - np.sqrt(x**2 + y**2 + z**2)).astype(np.float32)
    return volviz.Scene.of(volviz.Volume.from_array(values, name="ball"))


def all_knobs():
    """Part of the scene and knob, counted without the code that is tested."""
    some = volviz.Scene.of(volviz.Volume.from_array(np.zeros((3, 3, 3), np.uint8)))
    parts = [getattr(some, f.name) for f in fields(some)]
    return [
        (type(p).__name__.lower(), k) for p in parts if is_dataclass(p) for k in knobs_of(type(p))
    ]


def ends(spec):
    """The ends of a knob's range; of one without, two values."""
    return (spec.low, spec.high) if spec.low is not None else (-7.5, 1e4)


ids = [f"{part}.{k.name}" for part, k in all_knobs()]


@pytest.mark.parametrize(("part", "spec"), all_knobs(), ids=ids)
def test_every_knob_can_be_varied_by_both_of_its_names(scene, part, spec):
    values = list(spec.choices) or ([True, False] if spec.type is bool else list(ends(spec)))
    words = ",".join(map(str, values))
    for name in (f"{part}.{spec.name}", spec.name, spec.name.replace("_", "-")):
        made = vary.variants(scene, [vary.axis(f"{name}={words}", scene)])
        assert len(made) == len(values)
        for variant, value in zip(made, values, strict=True):
            assert getattr(getattr(variant.scene, part), spec.name) == value
            for f in fields(scene):
                if f.name != part:
                    assert getattr(variant.scene, f.name) is getattr(scene, f.name)
    if spec.choices:
        assert vary.axis(f"{spec.name}=all", scene).values == spec.choices


@pytest.mark.parametrize(("part", "spec"), all_knobs(), ids=ids)
def test_what_is_beyond_a_knob_is_refused_and_its_range_is_named(scene, part, spec):
    by_name = bool(spec.choices) or spec.type is bool
    endless = spec.low is None  # a place in the world
    beyond = [] if by_name or endless else [spec.low - 1, spec.high + 1]
    wrong = ["nonsense"] if by_name else ["x", *beyond]
    for value in wrong:
        with pytest.raises(UsageError) as told:
            vary.axis(f"{part}.{spec.name}={value}", scene)
        assert told.value.exit_code == 2
        named = [] if by_name or endless else [f"{spec.low:g} to {spec.high:g}"]
        for word in named:
            assert word in str(told.value)


def test_axes_are_crossed_and_the_last_changes_first(scene):
    axes = [vary.axis(t, scene) for t in ("step=0.5,1", "shading=none, phong")]
    made = vary.variants(scene, axes)
    found = [(v.scene.raycast.step, v.scene.raycast.shading) for v in made]
    assert found == [(0.5, "none"), (0.5, "phong"), (1.0, "none"), (1.0, "phong")]
    assert made[1].label == "step 0.5 · shading phong"
    assert made[1].changed == {"raycast.step": 0.5, "raycast.shading": "phong"}


def test_one_value_is_enough_and_may_come_twice(scene):
    assert len(vary.variants(scene, [vary.axis("step=1", scene)])) == 1
    one, other = vary.variants(scene, [vary.axis("step=1,1", scene)])
    assert one.scene == other.scene


@pytest.mark.parametrize(
    ("texts", "kind", "words"),
    [
        ([], UsageError, ["nothing varies"]),
        (["step=1,2", "raycast.step=3"], UsageError, ["raycast.step is varied twice"]),
        (["seed=" + ",".join(map(str, range(500)))], LimitError, ["500", "64"]),
        (["seed=" + ",".join(map(str, range(9))), "step=1,2,3,4,5,6,7,8"], LimitError, ["9 × 8"]),
    ],
)
def test_none_twice_and_too_many(scene, texts, kind, words):
    axes = [vary.axis(t, scene) for t in texts]
    with pytest.raises(kind) as told:
        vary.variants(scene, axes)
    for word in words:
        assert word in str(told.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("stepp=1", "did you mean 'step'?"),
        ("raycast.stepp=1", "did you mean 'raycast.step'?"),
        ("shading=fong", "did you mean 'phong'?"),
        ("preset=ct-bonee", "did you mean 'ct-bone'?"),
        ("view=frunt", "did you mean 'front'?"),
        ("background=bluu", "#rrggbb"),
        ("opacity=-1", "above 0"),
        ("unit-distance=x", "above 0"),
        ("step", "KNOB=VALUE"),
        ("=1", "KNOB=VALUE"),
        ("step=1,,2", "KNOB=VALUE"),
        ("step=all", "0.01 to 16"),
    ],
)
def test_mistakes_are_told_with_what_helps(scene, text, words):
    with pytest.raises(UsageError) as told:
        vary.axis(text, scene)
    assert words in str(told.value)
    assert "--vary" in str(told.value)


def test_what_is_no_knob_varies_too(scene):
    def only(text):
        (made,) = vary.variants(scene, [vary.axis(text, scene)], aspect=2.0)
        return made.scene

    dressed = volviz.Scene.of(scene.volume, preset="viridis")
    assert only("preset=viridis").transfer == dressed.transfer
    assert only("preset=Viridis").raycast.mode == dressed.raycast.mode
    assert only("view=top").camera == volume_camera(scene.volume, "top", aspect=2.0)
    assert only("background=#ff8000").background == volviz.Background.plain((1, 128 / 255, 0))
    assert only("background=transparent").background.top[3] == 0
    assert only("opacity=0.5").transfer == scene.transfer.faded(0.5)
    assert only("unit-distance=3").transfer.unit_distance == 3.0


def test_a_knob_is_turned_after_a_preset_that_brings_it(scene):
    axes = [vary.axis(t, scene) for t in ("shading=none,phong", "preset=ct-bone")]
    shadings = [v.scene.raycast.shading for v in vary.variants(scene, axes)]
    assert shadings == ["none", "phong"]


def test_surfaces_are_varied_each_keeping_its_own(scene):
    two = (SceneSurface.at(2.0), SceneSurface.at(4.0, finder="octree", opacity=0.5))
    wider = replace(scene, surfaces=two)
    names = ("marching-cubes", "marching-tetrahedra")
    made = vary.variants(wider, [vary.axis(f"method={','.join(names)}", wider)])
    assert [[s.surface.method for s in v.scene.surfaces] for v in made] == [[n, n] for n in names]
    for variant in made:
        assert [s.surface.isovalue for s in variant.scene.surfaces] == [2.0, 4.0]
        assert [s.surface.finder for s in variant.scene.surfaces] == ["bricks", "octree"]
        assert [s.look for s in variant.scene.surfaces] == [s.look for s in two]
    assert made[0].changed == {"surface.method": "marching-cubes"}
    with pytest.raises(UsageError, match=r"raycast\.shading or look\.shading"):
        vary.axis("shading=flat", wider)
    flat = vary.variants(wider, [vary.axis("look.shading=flat", wider)])[0]
    assert flat.label == "look.shading flat"
    assert {s.look.shading for s in flat.scene.surfaces} == {"flat"}
    faded = vary.variants(wider, [vary.axis("opacity=0.5", wider)])[0]
    assert faded.scene.surfaces == two, "the short name is that of the transfer function"
    with pytest.raises(UsageError, match="method"):
        vary.axis("method=marching-cubes", scene)


def test_the_reference_is_finer_than_all_and_means_the_same(scene):
    base = scene.with_knobs(gradient="forward", seed=5)
    texts = ("step=0.5,0.04", "shading=none,phong", "gradient=all", "samples=4,20")
    made = vary.variants(base, [vary.axis(t, base) for t in texts])
    everything = [v.scene for v in made]
    fine = [vary.fine(base, s, everything) for s in everything]
    assert {f.raycast.step for f in fine} == {0.02}
    assert {f.raycast.samples for f in fine} == {40}
    assert {(f.raycast.termination, f.raycast.seed, f.raycast.gradient) for f in fine} == {
        (1.0, 0, "forward")
    }
    assert [f.raycast.shading for f in fine] == [s.raycast.shading for s in everything]
    assert len({f.raycast for f in fine}) == 2
    again = [vary.fine(base, f, fine) for f in fine]
    assert all(a.raycast.step < f.raycast.step for a, f in zip(again, fine, strict=True))
    coarse = vary.fine(base, base, [base])
    assert (coarse.raycast.step, coarse.raycast.samples) == (0.125, 32)


def test_fine_values_are_values_of_their_knobs():
    seen = 0
    for _, spec in all_knobs():
        if spec.fine is AS_SCENE:
            assert spec.choices
        elif spec.fine is not None:
            assert spec.low <= spec.fine <= spec.high
            seen += 1
    assert seen >= 5
    assert not any(k.fine for k in knobs_of(Light)), "the light is no matter of exactness"


@pytest.mark.parametrize("name", ["surface.method", "method", "ambiguity", "surface.wireframe"])
def test_without_a_surface_its_knobs_are_told_to_need_one(scene, name):
    """Not that there is nothing of that name, which another scene would contradict."""
    with pytest.raises(UsageError, match="--isovalue") as told:
        vary.axis(f"{name}=all", scene)
    assert "no surface" in told.value.what
    there = scene.with_surfaces([SceneSurface.at(3.0)])
    part = "look" if "wireframe" in name else "surface"
    plain = name.removeprefix("surface.")
    assert vary.axis(f"{part}.{plain}=all", there).values
    with pytest.raises(UsageError, match="nothing is called"):
        vary.axis("methods-of-old=all", scene)


def test_one_value_alone_is_a_list_of_one(scene):
    assert vary.axis_of("step", 0.5, scene).values == (0.5,)


def test_a_knob_that_does_nothing_is_told(scene):
    """All rows of the table were alike, and nobody said why."""
    some = scene.with_surfaces([SceneSurface.at(2.0)])
    axis = vary.axis("surface.axis=all", some)
    alone = [v.scene for v in vary.variants(some, [axis])]
    assert vary.idle_warning(axis, alone) == (
        "surface.axis does nothing here: it is for method contour-tracing"
    )
    methods = vary.axis("surface.method=cuberille,contour-tracing", some)
    crossed = [v.scene for v in vary.variants(some, [axis, methods])]
    assert vary.idle_warning(axis, crossed) is None
    assert vary.idle_warning(methods, crossed) is None
    points = vary.axis("look.point-size=1,2", some)
    assert "dividing-cubes" in vary.idle_warning(points, alone)
    step = vary.axis("step=0.5,1", some)
    assert vary.idle_warning(step, [v.scene for v in vary.variants(some, [step])]) is None
