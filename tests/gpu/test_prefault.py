"""Memory that a worker touches first: who gets it, what is left, how it comes to a texture."""

from __future__ import annotations

import resource

import numpy as np
import pytest

from volviz.gpu import prefault
from volviz.gpu.residency import Residency
from volviz.model.frame import Voxels

SIZE = 64 << 20
needs_glibc = pytest.mark.skipif(not prefault.helps(SIZE), reason="not glibc")


def faults() -> int:
    """Pages that this thread had to get so far."""
    return resource.getrusage(resource.RUSAGE_THREAD).ru_minflt


def resident() -> int:
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


def clear(libc, size: int) -> int:
    """What a driver does for a texture: allocate and clear. The pages that had to be got for it."""
    before = faults()
    address = libc.malloc(size)
    prefault.ctypes.memset(address, 0, size)
    libc.free(address)
    return faults() - before


@needs_glibc
def test_who_asks_within_finds_the_pages_there():
    libc = prefault._libc()
    pages = SIZE // resource.getpagesize()
    memory = prefault.Memory(SIZE)
    with memory.given():
        assert clear(libc, SIZE) < pages // 100
    assert memory.ready
    prefault.trim()


@needs_glibc
def test_what_is_given_back_goes_to_the_system():
    before = resident()
    memory = prefault.Memory(SIZE)
    memory._worker.join()
    assert resident() > before + 0.9 * SIZE
    memory.release()
    memory.release()
    prefault.trim()
    assert resident() < before + 0.3 * SIZE


@needs_glibc
def test_giving_up_does_not_wait_for_the_rest():
    told = []
    memory = prefault.Memory(16 * SIZE, lambda: told.append(True))
    memory.release()
    assert memory.ready
    assert not told, "it was not stopped"


@needs_glibc
def test_more_than_there_is():
    with pytest.raises(MemoryError):
        prefault.Memory(1 << 60)


def test_small_textures_are_left_alone():
    assert not prefault.helps(prefault.WORTH - 1)


@needs_glibc
def test_a_volume_comes_in_memory_of_a_worker(gpu, monkeypatch):
    there = [False]
    monkeypatch.setattr(prefault, "WORTH", 1)
    monkeypatch.setattr(prefault.Memory, "ready", property(lambda self: there[0]))
    array = np.random.default_rng(3).integers(0, 65536, (40, 50, 60)).astype(np.uint16)
    one, two = (Voxels(array + n, 65535.0, 0.0) for n in (0, 1))
    resident = Residency(gpu)
    before = gpu.live["textures"]
    assert resident.upload(two, 1.0) == 0.0
    assert gpu.live["textures"] == before, "there is no memory for it yet"
    assert resident.upload(one, 1.0) == 0.0  # the other one is given up
    assert resident.upload(one, 1.0) == 0.0
    there[0] = True
    assert resident.upload(one, 60.0) == 1.0
    texture = resident.volume(one, linear=True)
    assert np.array_equal(np.frombuffer(texture.read(), np.uint16).reshape(array.shape), array)
    there[0] = False
    assert resident.upload(two, 60.0) == 0.0
    # who cannot go on without it waits
    found = resident.volume(two, linear=True)
    assert np.array_equal(np.frombuffer(found.read(), np.uint16).reshape(array.shape), two.array)
    resident.release()
    assert gpu.live["textures"] == before


@needs_glibc
def test_no_memory_for_it_is_a_limit(gpu, monkeypatch):
    from volviz.errors import LimitError

    def none(nbytes, done=None):
        raise MemoryError

    monkeypatch.setattr(prefault, "WORTH", 1)
    monkeypatch.setattr(prefault, "Memory", none)
    resident = Residency(gpu)
    volume = Voxels(np.zeros((4, 4, 4), np.uint16), 65535.0, 0.0)
    with pytest.raises(LimitError, match="memory"):
        resident.upload(volume, 1.0)
    resident.release()
