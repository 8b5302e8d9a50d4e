"""The arrows of ARCHITECTURE.md, read from the imports; and that libraries have homes."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "volviz"

# room: the rooms it may import besides itself and the ground floor (errors, progress, resources …)
ROOMS: dict[str, set[str]] = {
    "model": set(),
    "io": {"model"},
    "fields": {"model"},
    "classify": {"model", "fields"},
    "isosurface": {"model", "fields", "meshes"},
    "samples": {"model"},
    "meshes": {"model"},
    "gpu": {"model", "image"},
    "surface_colors": {"model", "fields", "classify", "sources", "io"},
    "resolve_surfaces": {"model", "fields", "isosurface", "meshes", "surface_colors"},
    "resolve": {"model", "fields", "classify", "resolve_surfaces"},
    "sources": {"model", "io", "samples"},
    "scene": {"model", "io", "fields", "classify", "gpu", "resolve", "sources", "image"},
    "lab": {
        "model",
        "fields",
        "classify",
        "isosurface",
        "meshes",
        "samples",
        "gpu",
        "resolve",
        "resolve_surfaces",
        "scene",
        "image",
    },
    "recipe": {"model", "classify", "sources", "scene", "image"},
    "app": {"model", "io", "samples", "resolve", "resolve_surfaces", "sources", "scene"},
    "image": set(),
    "doctor": {"gpu"},
    "ui": {
        "model",
        "fields",
        "classify",
        "isosurface",
        "meshes",
        "samples",
        "gpu",
        "resolve",
        "resolve_surfaces",
        "surface_colors",
        "sources",
        "scene",
        "image",
        "app",
        "recipe",
        "lab",
    },
    "cli": {
        "model",
        "io",
        "fields",
        "classify",
        "samples",
        "gpu",
        "ui",
        "resolve",
        "sources",
        "scene",
        "image",
        "doctor",
        "app",
        "recipe",
        "meshes",
        "isosurface",
        "surface_colors",
        "lab",
    },
}
GROUND = {
    "errors",
    "progress",
    "resources",
    "_version",
    "files",
    "folders",
    "text",
    "compiled",
}

# library: the rooms that may import it
HOMES: dict[str, set[str]] = {
    "moderngl": {"gpu", "doctor"},
    "glcontext": {"gpu", "doctor"},
    "imgui_bundle": {"ui", "gpu", "doctor"},
    "glfw": {"ui", "gpu", "doctor"},
    "copykitten": {"ui"},
    "nrrd": {"io"},
    "nibabel": {"io"},
    "pydicom": {"io"},
    "tifffile": {"io"},
    "mrcfile": {"io"},
    "trimesh": {"io"},
    "imagecodecs": {"io"},
    "typer": {"cli"},
    "rich": {"cli", "doctor"},
    "pyrr": {"model"},
    "msgspec": {"model", "classify"},
    "numba": {"isosurface", "meshes", "compiled"},
    "llvmlite": {"isosurface"},
    "scipy": set(),
    "vtk": set(),
    "SimpleITK": set(),
}


def modules() -> list[Path]:
    return sorted(p for p in PACKAGE.rglob("*.py") if "_data" not in p.parts)


def room_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return parts[0]


def imported(path: Path) -> set[str]:
    names: set[str] = set()
    tree = ast.parse(path.read_text())
    guarded = {
        id(node)
        for outer in ast.walk(tree)
        if isinstance(outer, ast.If) and "TYPE_CHECKING" in ast.dump(outer.test)
        for node in ast.walk(outer)
    }
    for node in ast.walk(tree):
        if id(node) in guarded:
            continue
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.update({f"{node.module}.{a.name}" for a in node.names})
    return names


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_arrows_point_down(path):
    room = room_of(path)
    if room in GROUND or room in ("__init__", "__main__"):
        return
    assert room in ROOMS, f"{room} is a new room: say in ROOMS what it may import"
    for name in imported(path):
        head, _, rest = name.partition(".")
        if head == "volviz" and rest:
            other = rest.split(".")[0]
            allowed = ROOMS[room] | GROUND | {room}
            assert other in allowed or other.startswith("__"), f"{path}: {room} imports {name}"
        elif head in HOMES:
            assert room in HOMES[head], f"{path}: {head} does not live in {room}"


def test_the_rules_can_fail(tmp_path):
    planted = tmp_path / "x.py"
    planted.write_text("def f():\n    from volviz.ui import window\n    import moderngl\n")
    assert {"volviz.ui.window", "moderngl"} <= imported(planted)


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_files_and_functions_are_short(path):
    text = path.read_text()
    assert text.count("\n") <= 400
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef) and node.end_lineno is not None:
            body = node.body[1:] if ast.get_docstring(node) else node.body
            length = node.end_lineno - body[0].lineno + 1 if body else 0
            assert length <= 40, f"{path.name}: {node.name} has {length} lines"


def test_shaders_are_short():
    for path in (ROOT / "shaders").rglob("*.*"):
        assert path.read_text().count("\n") <= 150, path


def test_import_is_light():
    code = (
        "import sys, volviz; volviz.VolvizError; volviz.__version__;"
        "print(' '.join(sorted({m.split('.')[0] for m in sys.modules})))"
    )
    loaded = set(subprocess.check_output([sys.executable, "-c", code], text=True).split())
    heavy = {*HOMES, "numba", "PIL", "platformdirs", "pydantic", "matplotlib"}
    assert not loaded & heavy


def test_volume_and_array_need_numpy_only():
    code = (
        "import sys, numpy, volviz; volviz.Volume.from_array(numpy.zeros((2, 2, 2)));"
        "print(' '.join(sorted({m.split('.')[0] for m in sys.modules})))"
    )
    loaded = set(subprocess.check_output([sys.executable, "-c", code], text=True).split())
    assert not loaded & ({*HOMES} - {"pyrr"})
