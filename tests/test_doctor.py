from __future__ import annotations

import getpass
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from volviz import doctor
from volviz.gpu import contexts_child
from volviz.gpu.contexts import open_gpu


@pytest.fixture(scope="module")
def report() -> dict[str, Any]:
    start = time.perf_counter()
    facts = doctor.report()
    assert time.perf_counter() - start < 20  # half of it on two idle cores
    return facts


@pytest.fixture(scope="module")
def broken() -> dict[str, Any]:
    """The report of a machine whose EGL has no driver."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere/vendor.json")
        patch.delenv("DISPLAY", raising=False)
        patch.delenv("WAYLAND_DISPLAY", raising=False)
        patch.delenv("VOLVIZ_BACKEND", raising=False)
        return doctor.report()


def test_report_is_json(report: dict[str, Any]) -> None:
    assert json.loads(json.dumps(report, allow_nan=False)) == report


def test_chosen_context_is_the_one_that_opens(report: dict[str, Any]) -> None:
    with open_gpu() as gpu:
        chosen = report["chosen"]
        assert report["usable"]
        assert (chosen["rung"], chosen["device"]) == (gpu.rung, gpu.device)
        assert (chosen["renderer"], chosen["reason"]) == (gpu.renderer, gpu.because)
        assert chosen["max_texture_3d"] == gpu.limits.max_texture_3d


def test_every_device_is_measured(report: dict[str, Any]) -> None:
    assert report["egl_devices"] or report["chosen"]["rung"] != "egl"
    for index, device in enumerate(report["egl_devices"]):
        assert device["device"] == index
        if device["ok"]:
            largest = device["largest_texture_3d"]
            x, y, z = largest["size"]
            assert largest["bytes"] == 2 * x * y * z <= contexts_child.LARGEST_BYTES
            assert max(x, y, z) <= device["max_texture_3d"]
            assert float(device["glsl"].split()[0]) >= 3.3
        else:
            assert device["reason"]


def test_every_rung_is_listed_with_its_outcome(report: dict[str, Any]) -> None:
    names = {entry["rung"] for entry in [*report["egl_devices"], *report["rungs"]]}
    assert names == {"egl", "window", "glfw-egl", "glfw-osmesa"}
    assert all(entry["reason"] for entry in report["rungs"])


def test_facts_of_the_machine(report: dict[str, Any]) -> None:
    assert report["python"].endswith(sys.version.split()[0])
    assert report["packages"]["numpy"]
    assert set(report["codecs"]) == set(doctor.CODECS)
    assert report["system"]["memory"] > report["system"]["memory_free"] > 0
    assert report["folders"]["shaders"].endswith("shaders")


def test_variables_that_matter_are_shown_and_others_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(doctor, "_graphics", dict)
    monkeypatch.setenv("LP_NUM_THREADS", "1")
    monkeypatch.setenv("VOLVIZ_BACKEND", "egl:0")
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "x.json")
    monkeypatch.setenv("SECRET_TOKEN", "hush")
    shown = doctor.report()["environment"]
    assert shown["LP_NUM_THREADS"] == "1"
    assert shown["VOLVIZ_BACKEND"] == "egl:0"
    assert shown["__EGL_VENDOR_LIBRARY_FILENAMES"] == "x.json"
    assert "SECRET_TOKEN" not in shown


def test_no_user_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_graphics", dict)
    monkeypatch.setattr(getpass, "getuser", lambda: "ada")
    monkeypatch.setenv("HOME", "/home/ada")
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    monkeypatch.setenv("LD_LIBRARY_PATH", "/home/ada/lib:/media/ada/disk:/home/adam/x:/opt/ada")
    text = json.dumps(doctor.report())
    assert '"~/.config/volviz"' in text
    assert '"~/lib:/media/<user>/disk:/home/adam/x:/opt/<user>"' in text
    assert "/ada/" not in text


def test_machine_without_a_driver(broken: dict[str, Any]) -> None:
    if broken["usable"]:
        pytest.skip("OSMesa is installed: there is a rung left")
    assert broken["chosen"] is None
    assert "egl: EGL lists no device" in broken["why_not"]
    reasons = {entry["rung"]: entry["reason"] for entry in broken["rungs"]}
    assert reasons["egl"] == "EGL lists no device (no driver is installed)"
    assert reasons["window"] == "neither DISPLAY nor WAYLAND_DISPLAY is set"
    text = doctor.as_text(broken)
    assert "volviz cannot draw here: no usable OpenGL 3.3" in text
    assert "libegl1 and libgl1-mesa-dri" in text


def test_wrong_backend_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VOLVIZ_BACKEND", "elg")
    assert doctor.ask_child("choose") == {"ok": False, "reason": "unknown backend 'elg'"}


def test_text_has_the_verdict_first(report: dict[str, Any]) -> None:
    lines = doctor.as_text(report).splitlines()
    assert lines[0].startswith("volviz ")
    assert lines[2].startswith("volviz draws with ")
    assert report["chosen"]["renderer"] in lines[2]
    assert any("largest that allocates" in line for line in lines)
    assert not any("\t" in line or line != line.rstrip() for line in lines)


# --- the child -------------------------------------------------------------------------------

FACTS = 'print(\'{"ok": true, "renderer": "x"}\', flush=True)\n'


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("import os; os.kill(os.getpid(), 11)", "the driver crashed (signal 11)"),
        ("import time; time.sleep(30)", "the driver did not answer within 1 s"),
        ("raise OSError('broken driver')", "the probe failed: OSError: broken driver"),
        ("print('no json')", "the probe said nothing"),
    ],
)
def test_child_that_fails_is_a_reason(code: str, reason: str) -> None:
    timeout = 1.0 if "sleep" in code else 20.0
    assert doctor.ask_child("egl:0", timeout, code) == {"ok": False, "reason": reason}


@pytest.mark.parametrize(
    ("code", "trouble"),
    [
        (FACTS + "import os; os.kill(os.getpid(), 9)", "the driver crashed (signal 9)"),
        (FACTS + "import time; time.sleep(30)", "the driver did not answer within 1 s"),
    ],
)
def test_facts_told_before_a_crash_survive(code: str, trouble: str) -> None:
    answer = doctor.ask_child("egl:0", 1.0 if "sleep" in code else 20.0, code)
    assert answer == {"ok": True, "renderer": "x", "trouble": trouble}


def test_child_takes_no_module_from_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "json.py").write_text("raise SystemExit('hijacked')", encoding="utf-8")
    (tmp_path / "numpy.py").write_text("raise SystemExit('hijacked')", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert doctor.ask_child("count").get("count", 0) >= 1


def test_largest_texture_stops_at_the_cap_and_at_the_memory(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with open_gpu() as gpu:
        assert contexts_child.largest_texture_3d(gpu, 1 << 20) == {
            "size": [128, 64, 64],
            "bytes": 1 << 20,
        }
        if gpu.software:
            monkeypatch.setattr(contexts_child, "free_memory", lambda: 4 * (1 << 21))
            assert contexts_child.largest_texture_3d(gpu) == {
                "size": [128, 128, 64],
                "bytes": 1 << 21,
            }
        assert gpu.live["textures"] == 0


def test_free_memory_is_plausible() -> None:
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert 0 < contexts_child.free_memory() <= total
