"""Letters that our font lacks come from a font of the system, asked for once, on a worker."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import volviz
from volviz.samples import SAMPLES, sample
from volviz.ui import fonts, theme
from volviz.ui.im import FONT, imgui

ARMENIAN = "Հ"


@pytest.fixture
def atlas():
    before = imgui.get_current_context()
    context = imgui.create_context()
    imgui.set_current_context(context)
    theme.load_fonts()
    yield imgui.get_io().fonts
    imgui.destroy_context(context)
    if before is not None:
        imgui.set_current_context(before)


def settle(fallback: fonts.Fallback, text: str) -> None:
    end = time.monotonic() + 30
    while True:
        fallback.cover([text], lambda: None)
        if fallback._job is None:
            return
        assert time.monotonic() < end
        time.sleep(0.01)


def test_what_our_font_has_is_not_looked_for(atlas, monkeypatch):
    monkeypatch.setattr(fonts, "found", lambda *_: pytest.fail("looked for"))
    settle(fonts.Fallback(), "Größe µm αβγ Å × ² −")


def test_a_letter_comes_from_the_system(atlas):
    if not any("DejaVuSans" in file.name for file in fonts.found(ARMENIAN)):
        pytest.skip("this system has no such font")
    assert not atlas.fonts[0].is_glyph_in_font(ord(ARMENIAN))
    fallback = fonts.Fallback()
    settle(fallback, f"{ARMENIAN}.npy")
    assert atlas.fonts[0].is_glyph_in_font(ord(ARMENIAN))
    assert atlas.fonts[0].is_glyph_in_font(ord("A"))
    assert len(atlas.fonts) == 1
    assert len(fallback.files) == 1


def test_what_no_font_has_is_looked_for_once(atlas, monkeypatch):
    asked, main = [], threading.get_ident()

    def nothing(letter, known):
        assert threading.get_ident() != main
        asked.append(letter)
        return [FONT]  # it does not have it either

    monkeypatch.setattr(fonts, "found", nothing)
    fallback = fonts.Fallback()
    for text in ("中文", "中文.npy", "文中"):
        settle(fallback, text)
    assert sorted(asked) == ["中", "文"]


def test_a_font_that_is_none_is_passed_over(atlas, monkeypatch, tmp_path):
    broken = tmp_path / "broken.ttf"
    broken.write_bytes(b"no font")
    monkeypatch.setattr(fonts, "found", lambda *_: [broken])
    fallback = fonts.Fallback()
    settle(fallback, "中")
    assert fallback.files == []


def test_files_are_there_and_new(monkeypatch):
    monkeypatch.setattr(fonts, "_asked", lambda _: FONT)
    monkeypatch.setattr(fonts, "_usual", lambda: [FONT, Path("/nowhere.ttf")])
    assert fonts.found("中") == [FONT]
    assert fonts.found("中", [FONT]) == []
    monkeypatch.setattr(fonts.shutil, "which", lambda _: None)
    monkeypatch.undo()
    monkeypatch.setattr(fonts.shutil, "which", lambda _: "/no/such/program")
    assert fonts._asked("中") is None


@pytest.mark.parametrize("name", SAMPLES)
def test_samples_speak_in_our_own_letters(name, atlas):
    text = f"{SAMPLES[name].about}{sample(name, size=8).info.value_unit}"
    assert not [c for c in text if not atlas.fonts[0].is_glyph_in_font(ord(c))]


def test_units_and_headers_are_covered_too():
    info = {"value_unit": "a₀⁻³", "fields": {"Patient": "山田^太郎"}, "channel_names": ("Հ",)}
    volume = volviz.Volume.from_array(np.zeros((3, 3, 3)), channels=1, **info)
    scene = SimpleNamespace(volume=volume, source=None)
    empty = SimpleNamespace(all=())
    app = SimpleNamespace(scene=scene, settings=SimpleNamespace(recent=()), messages=empty)
    letters = set("".join(fonts.names(app)))  # type: ignore[arg-type]
    assert set("a₀⁻³Patient山田太郎Հ") <= letters
