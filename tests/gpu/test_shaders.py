"""Programs: compiled once, reloaded when their files change, filled with uniforms."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from tests.gpu.conftest import Write
from volviz.errors import GraphicsError
from volviz.gpu import shaders
from volviz.gpu.checked import Gpu
from volviz.gpu.contexts import open_gpu
from volviz.gpu.shaders import program, set_uniforms

VERTEX = """#version 330 core
void main() {
    gl_Position = vec4((gl_VertexID & 1) * 4 - 1, (gl_VertexID >> 1) * 4 - 1, 0.0, 1.0);
}
"""


@pytest.fixture(scope="module")
def own() -> Iterator[Gpu]:
    with open_gpu() as gpu:
        yield gpu


def test_real_compiler_error_names_our_file_and_line(
    own: Gpu, write: Write, tmp_path: Path
) -> None:
    write(main_v=VERTEX)
    write(
        main='#version 330 core\nout vec4 c;\n#include "@mode"\nvoid main() { c = pick(); }\n',
        raycast__modes__broken="// a mode\n\nvec4 pick() {\n    float x = valeu;\n"
        "    return vec4(x);\n}\n",
    )
    choices = {"@mode": "raycast/modes/broken.glsl"}
    with pytest.raises(GraphicsError, match="float x = valeu;") as caught:
        program(own, "main_v.vert", "main.glsl", choices, root=tmp_path)
    assert str(caught.value).startswith("shaders/raycast/modes/broken.glsl:4: error")
    own.check("after a failed compilation")


def test_program_is_compiled_once_per_choices(own: Gpu, write: Write, tmp_path: Path) -> None:
    write(
        main_v=VERTEX,
        main='#version 330 core\nout vec4 c;\n#include "@m"\nvoid main() { c = vec4(M); }\n',
        one="#define M 1.0\n",
        two="#define M 2.0\n",
    )

    def get(mode: str) -> moderngl.Program:
        return program(own, "main_v.vert", "main.glsl", {"@m": f"{mode}.glsl"}, root=tmp_path)

    assert get("one") is get("one")
    assert get("one") is not get("two")


def colour(gpu: Gpu, made: moderngl.Program) -> list[float]:
    target = gpu.framebuffer((1, 1), "f4")
    target.use()
    gpu.ctx.vertex_array(made, []).render(moderngl.TRIANGLES, vertices=3)
    got = np.frombuffer(target.read(components=4, dtype="f4"), np.float32).tolist()
    gpu.release_framebuffer(target)
    gpu.check("drawing")
    return got


def later(path: Path, text: str) -> None:
    """Write a file with a newer mtime, however coarse the clock of the file system is."""
    before = path.stat().st_mtime_ns if path.exists() else 0
    path.write_text(text, encoding="utf-8")
    stamp = max(path.stat().st_mtime_ns, before + 1_000_000_000)
    os.utime(path, ns=(stamp, stamp))


def test_changed_file_reloads_and_the_last_good_program_stays(
    own: Gpu, write: Write, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    part = tmp_path / "part.glsl"
    write(
        main_v=VERTEX,
        main='#version 330 core\nout vec4 c;\n#include "part.glsl"\nvoid main() { c = vec4(M); }\n',
        part="#define M 1.0\n",
    )

    def get() -> moderngl.Program:
        shaders.reload(own)
        return program(own, "main_v.vert", "main.glsl", root=tmp_path)

    first = get()
    assert colour(own, first) == [1.0] * 4
    later(part, "#define M 2.0\n")
    second = get()
    assert second is not first
    assert colour(own, second) == [2.0] * 4

    with caplog.at_level(logging.ERROR):
        later(part, "#define M nonsense\n")
        assert [get() for _ in range(3)] == [second] * 3
        later(part, '#include "new.glsl"\n')
        assert [get() for _ in range(3)] == [second] * 3
    assert len(caplog.records) == 2  # each broken state is told once
    assert "shaders/main.glsl:4: error" in caplog.messages[0]
    assert "cannot read the shader 'new.glsl'" in caplog.messages[1]
    assert any("new.glsl" in line for line in shaders.reload_errors(own))
    assert colour(own, get()) == [2.0] * 4

    later(tmp_path / "new.glsl", "#define M 3.0\n")  # only the missing file appears
    assert colour(own, get()) == [3.0] * 4
    assert not shaders.reload_errors(own)


def test_files_are_looked_at_when_asked_only(own: Gpu, write: Write, tmp_path: Path) -> None:
    write(main_v=VERTEX, main="#version 330 core\nout vec4 c;\nvoid main() { c = vec4(1); }\n")
    first = program(own, "main_v.vert", "main.glsl", root=tmp_path)
    assert not shaders.reload(own)
    later(tmp_path / "main.glsl", "garbage")
    assert program(own, "main_v.vert", "main.glsl", root=tmp_path) is first
    assert shaders.reload(own)
    assert not shaders.reload(own)  # told once
    assert program(own, "main_v.vert", "main.glsl", root=tmp_path) is first


def test_program_that_never_compiled_is_tried_again(own: Gpu, write: Write, tmp_path: Path) -> None:
    write(main_v=VERTEX, main="#version 330 core\ngarbage\n")
    for _ in range(2):
        with pytest.raises(GraphicsError, match=r"main\.glsl"):
            program(own, "main_v.vert", "main.glsl", root=tmp_path)
    assert not shaders.reload(own)
    later(tmp_path / "main.glsl", "#version 330 core\nout vec4 c;\nvoid main() { c = vec4(1); }\n")
    assert shaders.reload(own)
    assert colour(own, program(own, "main_v.vert", "main.glsl", root=tmp_path)) == [1.0] * 4


def test_sources_are_dumped_when_asked(
    own: Gpu, write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(shaders.DUMP_VARIABLE, str(tmp_path / "dump"))
    write(
        main_v=VERTEX,
        main='#version 330 core\nout vec4 c;\n#include "@m"\nvoid main() { c = vec4(M); }\n',
        one="#define M 1.0\n",
    )
    program(own, "main_v.vert", "main.glsl", {"@m": "one.glsl"}, root=tmp_path)
    assert {p.name for p in (tmp_path / "dump").iterdir()} == {
        "main_v-one.vert",
        "main-one.glsl",
    }
    assert "// from: shaders/one.glsl" in (tmp_path / "dump" / "main-one.glsl").read_text()


# --- uniforms --------------------------------------------------------------------------------

UNIFORMS = """#version 330 core
uniform float u_float;
uniform int u_int;
uniform uint u_uint;
uniform bool u_bool;
uniform vec3 u_vec3;
uniform ivec2 u_ivec2;
uniform mat3 u_mat3;
uniform mat4x2 u_mat4x2;  // 4 columns, 2 rows
uniform mat2 u_mat2s[2];
uniform vec2 u_points[2];
uniform float u_list[3];
uniform float u_dropped;
uniform Block { vec4 u_in_block; };
uniform int u_which;
out vec4 c;
void main() {
    if (u_which == 0) c = vec4(u_float, u_int, u_uint, u_bool);
    if (u_which == 1) c = vec4(u_vec3, u_ivec2.y);
    if (u_which == 2) c = vec4(u_mat3 * vec3(1.0, 10.0, 100.0), 0.0);
    if (u_which == 3) c = vec4(u_mat4x2 * vec4(1.0, 10.0, 100.0, 1000.0), 0.0, 0.0);
    if (u_which == 4) c = vec4(u_mat2s[1] * vec2(1.0, 10.0), u_points[1]);
    if (u_which == 5) c = vec4(u_list[0], u_list[1], u_list[2], u_in_block.x);
}
"""


@pytest.fixture
def filled(own: Gpu, write: Write, tmp_path: Path) -> moderngl.Program:
    write(main_v=VERTEX, main=UNIFORMS)
    return program(own, "main_v.vert", "main.glsl", root=tmp_path)


def test_uniforms_arrive(own: Gpu, filled: moderngl.Program) -> None:
    mat3 = np.arange(9.0).reshape(3, 3)
    mat4x2 = np.arange(8, dtype=np.float32).reshape(2, 4)
    mat2s = np.arange(8.0).reshape(2, 2, 2)
    set_uniforms(
        filled,
        u_float=1,
        u_int=np.int64(-2),
        u_uint=3,
        u_bool=True,
        u_vec3=(1, 2.5, 3),
        u_ivec2=np.array([4, 5], np.int16),
        u_mat3=mat3,
        u_mat4x2=mat4x2,
        u_mat2s=mat2s,
        u_points=[(1, 2), (3, 4)],
        u_list=np.array([7, 8, 9], np.float64),
        u_dropped=1.0,
        Block=0,
    )
    block = own.buffer(np.array([11, 0, 0, 0], np.float32))
    block.bind_to_uniform_block(0)
    expected = [
        [1, -2, 3, 1],
        [1, 2.5, 3, 5],
        [*(mat3 @ (1, 10, 100)), 0],
        [*(mat4x2 @ (1, 10, 100, 1000)), 0, 0],
        [*(mat2s[1] @ (1, 10)), 3, 4],
        [7, 8, 9, 11],
    ]
    for which, colours in enumerate(expected):
        set_uniforms(filled, u_which=which)
        assert colour(own, filled) == colours
    block.release()


def test_uniform_that_no_source_declares_is_an_error(filled: moderngl.Program) -> None:
    with pytest.raises(
        ValueError, match="no uniform 'u_flaot' is declared; did you mean 'u_float'"
    ):
        set_uniforms(filled, u_flaot=1.0)
    set_uniforms(filled, u_dropped=1.0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("u_float", (1.0, 2.0)),
        ("u_vec3", (1.0, 2.0)),
        ("u_mat3", np.eye(4)),
        ("u_mat4x2", np.zeros((4, 2))),
        ("u_int", 1.5),
        ("u_list", (1.0, 2.0)),
        ("u_float", "1.0"),
        ("u_float", None),
    ],
)
def test_wrong_size_or_kind_is_an_error(filled: moderngl.Program, name: str, value: object) -> None:
    with pytest.raises(ValueError, match=f"uniform '{name}' takes"):
        set_uniforms(filled, **{name: value})
