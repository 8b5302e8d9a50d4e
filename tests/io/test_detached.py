from __future__ import annotations

from pathlib import Path

import pytest

from volviz.errors import InputError
from volviz.io.detached import expand_pattern, resolve_sibling


def test_sibling_in_the_folder_and_below(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    for name in ("a b.raw", "sub/c.raw", "50%.raw", "%2e.raw", "ünï 🫀.raw"):
        (tmp_path / name).write_bytes(b"x")
        assert resolve_sibling(tmp_path / "h.nhdr", name, field="f") == tmp_path.resolve() / name
    assert resolve_sibling(tmp_path / "h", "./sub\\c.raw", field="f").name == "c.raw"
    assert resolve_sibling(tmp_path / "h", "sub/../a b.raw", field="f").name == "a b.raw"
    assert resolve_sibling(tmp_path / "h", str(tmp_path / "a b.raw"), field="f").name == "a b.raw"


def test_sibling_outside_only_where_allowed(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "x.raw").write_bytes(b"x")
    header = tmp_path / "in" / "h.nhdr"
    with pytest.raises(InputError, match=r"h\.nhdr: data file: .*outside.*--allow-outside"):
        resolve_sibling(header, "../out/x.raw", field="data file")
    allowed = tmp_path / "out"
    assert resolve_sibling(header, "../out/x.raw", field="f", allow_outside=allowed).is_file()
    with pytest.raises(InputError, match="outside"):
        resolve_sibling(header, "../y.raw", field="f", allow_outside=allowed)


def test_sibling_missing_names_the_place(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected .*gone\.raw — put it there"):
        resolve_sibling(tmp_path / "h", "gone.raw", field="f")


def test_patterns_of_names() -> None:
    def names(pattern: str, first: int, last: int, step: int) -> list[str]:
        return expand_pattern(pattern, first, last, step, file=Path("h"), field="f", most=100)

    assert names("s%03d.raw", 1, 3, 1) == ["s001.raw", "s002.raw", "s003.raw"]
    assert names("s%d", 9, 5, -2) == ["s9", "s7", "s5"]
    assert names("100%%_%2i", 1, 1, 1) == ["100%_ 1"]
    for bad in ("s.raw", "%s", "%d%d", "%n%d", "%999999999d", "%*d", "%(x)d"):
        with pytest.raises(InputError, match="no pattern with one number"):
            names(bad, 1, 2, 1)
    for first, last, step in ((1, 3, 0), (3, 1, 1), (1, 3, -1)):
        with pytest.raises(InputError, match="never arrives"):
            names("%d", first, last, step)
    with pytest.raises(InputError, match="more than 100"):
        names("%d", 0, 10**12, 1)
