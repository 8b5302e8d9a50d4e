from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from volviz import resources
from volviz.errors import GraphicsError, OutputError
from volviz.gpu import shaders
from volviz.gpu.checked import Gpu
from volviz.gpu.contexts import open_gpu
from volviz.gpu.shaders import Source, explain, program, set_uniforms, stitch

Write = Callable[..., None]

VERTEX = """#version 330 core
void main() {
    gl_Position = vec4((gl_VertexID & 1) * 4 - 1, (gl_VertexID >> 1) * 4 - 1, 0.0, 1.0);
}
"""


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(**files: str) -> None:
        for name, text in files.items():
            path = tmp_path / name.replace("__", "/")
            path = path.with_suffix(".vert" if name == "main_v" else path.suffix or ".glsl")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")

    return write


@pytest.fixture(scope="module")
def own() -> Iterator[Gpu]:
    with open_gpu() as gpu:
        yield gpu


# --- the composer, as text -------------------------------------------------------------------


def test_includes_nest_and_come_once(write: Write, tmp_path: Path) -> None:
    write(
        main='#version 330 core\n#include "lib/a.glsl"\n#include "lib/b.glsl"\nend\n',
        lib__a='a1\n#include "lib/b.glsl"\na3\n',
        lib__b="b1\n",
    )
    source = stitch("main.glsl", root=tmp_path)
    assert source.text == "#version 330 core\na1\nb1\na3\nend"
    assert source.lines == (
        ("shaders/main.glsl", 1),
        ("shaders/lib/a.glsl", 1),
        ("shaders/lib/b.glsl", 1),
        ("shaders/lib/a.glsl", 3),
        ("shaders/main.glsl", 4),
    )
    assert source.where(3) == ("shaders/lib/b.glsl", 1)
    assert source.where(999) == ("shaders/main.glsl", 4)
    assert "#line" not in source.text


def test_a_file_may_include_itself_or_its_includer(write: Write, tmp_path: Path) -> None:
    write(main='#version 330 core\n#include "a.glsl"\n', a='#include "main.glsl"\nx\n')
    assert stitch("main.glsl", root=tmp_path).text == "#version 330 core\nx"


def test_choice_takes_the_file_it_is_mapped_to(write: Write, tmp_path: Path) -> None:
    write(
        main='#version 330 core\n#include "@mode"\n',
        modes__mip='mip\n#include "@extra"\n',
        modes__dvr="dvr\n",
        extra="extra\n",
    )
    mip = stitch("main.glsl", {"@mode": "modes/mip.glsl", "@extra": "extra.glsl"}, tmp_path)
    dvr = stitch("main.glsl", {"@mode": "modes/dvr.glsl"}, tmp_path)
    assert mip.text.endswith("mip\nextra")
    assert dvr.text.endswith("dvr")
    with pytest.raises(
        GraphicsError, match=r"shaders/main\.glsl:2: no file was chosen for '@mode'.*'@mod'"
    ):
        stitch("main.glsl", {"@mod": "modes/dvr.glsl"}, tmp_path)


def test_include_in_a_comment_is_a_comment(write: Write, tmp_path: Path) -> None:
    write(
        main='#version 330 core\n// #include "gone.glsl"\n/*\n#include "gone.glsl"\n*/\n'
        '  #  include "a.glsl"  // why\n',
        a="a\n",
    )
    assert stitch("main.glsl", root=tmp_path).text.endswith("*/\na")


def test_missing_file_names_the_place_and_the_nearest(write: Write, tmp_path: Path) -> None:
    write(main='#version 330 core\n\n#include "lib/sampel.glsl"\n', lib__sample="x\n")
    with pytest.raises(
        GraphicsError, match=r"shaders/main\.glsl:3: .*'lib/sampel.glsl'.*'lib/sample\.glsl'"
    ):
        stitch("main.glsl", root=tmp_path)
    with pytest.raises(GraphicsError, match=r"mian\.glsl.*'main\.glsl'"):
        stitch("mian.glsl", root=tmp_path)


@pytest.mark.parametrize("path", ["../secret.glsl", "/etc/passwd"])
def test_include_outside_the_folder_is_refused(path: str, write: Write, tmp_path: Path) -> None:
    write(shaders__main=f'#version 330 core\n#include "{path}"\n', secret="x\n")
    with pytest.raises(GraphicsError, match="leaves the shaders folder"):
        stitch("main.glsl", root=tmp_path / "shaders")


def test_other_forms_of_include_are_refused(write: Write, tmp_path: Path) -> None:
    write(main="#version 330 core\n#include <a.glsl>\n")
    with pytest.raises(GraphicsError, match=r'main\.glsl:2: write includes as #include "path"'):
        stitch("main.glsl", root=tmp_path)


def test_version_is_the_first_line_and_only_there(write: Write, tmp_path: Path) -> None:
    write(
        late="// words\n#version 330 core\n",
        main='#version 330 core\n#include "other.glsl"\n',
        other="x\n#version 330 core\n",
        empty="",
    )
    for name, where in (("late", "late.glsl:2"), ("main", "other.glsl:2"), ("empty", "empty")):
        with pytest.raises(GraphicsError, match=where):
            stitch(f"{name}.glsl", root=tmp_path)


def test_marked_text_tells_where_each_part_is_from(write: Write, tmp_path: Path) -> None:
    write(main='#version 330 core\none\n#include "a.glsl"\ntwo\n', a="aa\n")
    source = stitch("main.glsl", root=tmp_path)
    assert source.marked() == (
        "#version 330 core\n// from: shaders/main.glsl\none\n"
        "// from: shaders/a.glsl\naa\n// from: shaders/main.glsl\ntwo\n"
    )
    source.dump(tmp_path / "out" / "main.glsl")
    assert (tmp_path / "out" / "main.glsl").read_text(encoding="utf-8") == source.marked()
    with pytest.raises(OutputError):
        source.dump(tmp_path / "main.glsl" / "below")


def test_declared_uniforms(write: Write, tmp_path: Path) -> None:
    write(
        main="""#version 330 core
uniform float u_a;
uniform highp vec3 u_b , u_c[3], u_d = vec3(1, 2, max(3, 4)), u_e;
uniform
    sampler3D u_f;
layout(std140) uniform Lights { vec4 u_inside; } lamps;
// uniform float u_comment;
/* uniform float u_block; */
uniform Light u_lights[2];
float not_uniform;
"""
    )
    assert stitch("main.glsl", root=tmp_path).uniforms == frozenset(
        {"u_a", "u_b", "u_c", "u_d", "u_e", "u_f", "Lights", "u_lights"}
    )


def test_every_shipped_include_resolves_and_none_uses_line() -> None:
    root = resources.shader_dir()
    for path in sorted(root.rglob("*.*")):
        text = path.read_text(encoding="utf-8")
        assert "#line" not in text, path
        assert len(text.splitlines()) <= 150, path


# --- compiler logs ---------------------------------------------------------------------------

LOGS = {
    "mesa": "0:3(9): error: `valeu' undeclared",
    "nvidia": '0(3) : error C1503: undefined variable "valeu"',
    "amd": "ERROR: 0:3: error(#143) Undeclared identifier: valeu",
    "intel": "ERROR: 0:3: 'valeu' : undeclared identifier",
}


@pytest.mark.parametrize("driver", LOGS)
def test_log_is_rewritten_to_our_file_and_line(driver: str) -> None:
    lines = (("shaders/main.frag", 1), ("shaders/lib/a.glsl", 7), ("shaders/modes/broken.glsl", 4))
    source = Source("main.frag", "#version 330 core\nok\n    x = valeu;", lines)
    vertex = Source("v.vert", "#version 330 core\n1\n2", (("shaders/v.vert", 1),) * 3)
    log = f"GLSL Compiler failed\n\nfragment_shader\n===============\n{LOGS[driver]}\n"
    error = explain(log, {"vertex_shader": vertex, "fragment_shader": source})
    assert str(error).startswith("shaders/modes/broken.glsl:4: error")
    assert "valeu" in error.what
    assert error.what.endswith("in: x = valeu;")
    assert error.exit_code == 5
    assert "shaders/modes/broken.glsl:4" in error.__notes__[0]


def test_warnings_are_not_the_error_and_further_errors_are_counted() -> None:
    source = Source(
        "m.frag", "#version 330 core\na\nb", tuple(("shaders/m.frag", n) for n in (1, 2, 3))
    )
    log = (
        "fragment_shader\n====\n0:2(1): warning: unused\n0:2(1): error: first\n"
        "0:3(1): error: second\n0:99(1): error: beyond the end\n"
    )
    error = explain(log, {"fragment_shader": source})
    assert str(error) == "shaders/m.frag:2: error: first in: a (and 2 more)"
    assert "shaders/m.frag:2: warning: unused" in error.__notes__[0]


def test_linker_log_names_the_files() -> None:
    source = Source("m.frag", "#version 330 core", (("shaders/m.frag", 1),))
    error = explain("GLSL Linker failed\n\nerror: v_x not written", {"fragment_shader": source})
    assert str(error) == "shaders/m.frag: GLSL Linker failed error: v_x not written"


# --- programs --------------------------------------------------------------------------------


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


def test_installed_shaders_are_not_watched(
    own: Gpu, write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(main_v=VERTEX, main="#version 330 core\nout vec4 c;\nvoid main() { c = vec4(1); }\n")
    first = program(own, "main_v.vert", "main.glsl", root=tmp_path)
    monkeypatch.setattr(resources, "checkout", lambda: None)
    later(tmp_path / "main.glsl", "garbage")
    assert program(own, "main_v.vert", "main.glsl", root=tmp_path) is first


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
