"""Shaders as text: includes, the line map, compiler logs told in our files and lines."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.gpu.conftest import Write
from volviz import resources
from volviz.errors import GraphicsError, OutputError
from volviz.gpu.shaders import explain
from volviz.gpu.stitching import Source, stitch


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
