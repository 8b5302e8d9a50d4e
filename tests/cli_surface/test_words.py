"""What the command line says of words it does not take, and how its tables fit a terminal."""

from __future__ import annotations

import io
import re
import sys

import pytest

from volviz.cli import run, show


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("surface x.nrrd --isovalue abc", "--isovalue: 'abc' is not a number — see 'volviz surf"),
        ("surface x.nrrd --isovalue=a=c", "--isovalue: 'a=c' is not a number"),
        ("surface x.nrrd --isovalue 3 --isovalue z", "--isovalue: 'z' is not a number"),
        ("surface x.nrrd --isovalue --report", "--isovalue: '--report' is not a number"),
        ("surface x.nrrd --tetrahedra five", "--tetrahedra: 'five' is not a whole number"),
        ("surface x.nrrd --isovalue", "--isovalue: a value is missing — value on the surface; "),
        ("surface x.nrrd --isovalue", "; see 'volviz surface --help'"),
        ("surface x.nrrd -o", "-o: a value is missing — mesh to write: .stl, .ply, .obj or .glb"),
        ("surface x.nrrd --isovalu 3", "no option --isovalu — did you mean '--isovalue'?"),
        ("surface", "FILE is missing — see 'volviz surface --help'"),
        ("surface x.nrrd --keep-largest=3", "--keep-largest"),
        ("compare x.nrrd --repeat x", "--repeat: 'x' is not a whole number — see 'volviz compare"),
        ("render x.nrrd --size", "see 'volviz render --help'"),
        ("x.nrrd --series", "--series: a value is missing"),
        ("x.nrrd --azimth 3", "did you mean '--azimuth'?"),
        ("--bogus", "no option --bogus"),
    ],
)
def test_a_word_that_is_not_taken_is_named_with_its_option(words, told, capsys):
    assert run(words.split()) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("volviz: error: ")
    assert said.err.count("\n") == 1
    assert told in said.err


class Terminal(io.StringIO):
    def isatty(self):
        return True


COLUMNS = ("surface.method", "ms", "triangles", "open edges", "distance mm", "truth mean mm")
ROWS = [
    ("discretized-marching-cubes", "12.5", "12,334", "17", "0.0123", "0.25"),
    ("cuberille", "9.25", "99,001", "3", "0.875", "0.0625"),
]


@pytest.mark.parametrize("width", [50, 64, 80, 100, 200])
def test_no_word_of_a_table_is_broken_however_narrow_the_terminal(width, monkeypatch):
    out = Terminal()
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setenv("TERM", "xterm")
    show.table("", COLUMNS, ROWS, names=1)
    plain = re.sub(r"\x1b\[[0-9;]*m", "", out.getvalue())
    lines = [line.rstrip() for line in plain.splitlines()]
    assert max(map(len, lines)) <= width
    blocks = [b.splitlines() for b in "\n".join(lines).split("\n\n")]
    for block in blocks:
        assert [line.split()[0] for line in block[1:]] == [row[0] for row in ROWS]
    for k, row in enumerate(ROWS):
        assert [w for block in blocks for w in block[1 + k].split()[1:]] == list(row[1:])
    assert (len(blocks) == 1) == (width >= 92)


def test_a_table_that_is_piped_stays_one_line_a_row(capsys):
    wide = [(row[0], *(w * 9 for w in row[1:])) for row in ROWS]
    show.table("", COLUMNS, wide, names=1)
    assert [line.split() for line in capsys.readouterr().out.splitlines()[1:]] == list(
        map(list, wide)
    )
