"""What is no path, no volume and no name is refused in one line; progress is told to a callable."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import volviz
from volviz.errors import UsageError

VOLUME = volviz.Volume.from_array(np.arange(60, dtype=np.uint8).reshape(3, 4, 5))


@pytest.mark.parametrize(
    ("call", "names"),
    [
        (lambda _: volviz.load(None), "NoneType"),
        (lambda _: volviz.probe(5), "int"),
        (lambda _: volviz.load(b"a.nrrd"), "bytes"),
        (lambda folder: volviz.save_volume(5, folder / "a.nrrd"), "int"),
        (lambda _: volviz.save_volume(VOLUME, None), "NoneType"),
        (lambda _: volviz.sample(5), "int"),
        (lambda _: volviz.sample([]), "list"),
    ],
)
def test_the_wrong_kind_is_named(call, names, tmp_path):
    with pytest.raises(UsageError, match=names) as raised:
        call(tmp_path)
    assert "\n" not in str(raised.value)
    assert not list(tmp_path.iterdir())


def test_progress_is_told_and_cancels(tmp_path: Path):
    told = []
    path = tmp_path / "a.nrrd"
    progress = volviz.Progress(lambda fraction, text: told.append((fraction, text)))
    volviz.save_volume(VOLUME, path, progress=progress)
    read = volviz.load(path, progress=progress)
    assert np.array_equal(read.data, VOLUME.data)
    assert told
    assert all(f is None or 0 <= f <= 1 for f, _ in told)
    progress.cancel()
    with pytest.raises(volviz.VolvizError):
        volviz.load(path, progress=progress)
