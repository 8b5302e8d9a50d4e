"""The derived cases: proved one by one, and the neighbour's view of every face."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from volviz.isosurface.cases import (
    CENTER,
    CORNERS,
    EDGES,
    FACES,
    _decisions,
    ambiguous_faces,
    cases,
    historic_bits,
    in_one_face,
    inside,
    loops,
    segments,
)

DECISIONS = _decisions()


def triangles(entry):
    table = cases()
    return table.triangles[table.start[entry] : table.start[entry + 1]].tolist()


def test_cases_and_decisions_are_complete():
    table = cases()
    assert len(DECISIONS) == len(table.start) - 1 == 656
    assert [table.entry[c, b] for c, b in DECISIONS] == list(range(656))


def test_every_crossed_edge_is_in_exactly_one_loop():
    for case, bits in DECISIONS:
        crossed = [i for i, (a, b) in enumerate(EDGES) if inside(case, a) != inside(case, b)]
        assert sorted(e for ring in loops(case, bits) for e in ring) == crossed


def test_triangles_of_an_entry_are_discs_bounded_by_its_loops():
    for entry, (case, bits) in enumerate(DECISIONS):
        edges = Counter((t[i], t[(i + 1) % 3]) for t in triangles(entry) for i in range(3))
        rim = {(r[i - 1], r[i]) for r in loops(case, bits) for i in range(len(r))}
        assert set(edges.values()) <= {1}
        assert {e for e in edges if e[::-1] not in edges} == rim
        for a, b in edges:
            if (a, b) not in rim and (b, a) not in rim and CENTER not in (a, b):
                assert not in_one_face(a, b)


@pytest.mark.parametrize("axis", range(3))
def test_neighbours_see_the_same_contour_on_their_face(axis):
    """For every sign of the face's corners and either decision, whatever the other corners are."""
    low, high = 2 * axis, 2 * axis + 1
    shift = 1 << axis
    for signs in range(16):
        for bit in (0, 1):
            near = sum(1 << c for i, c in enumerate(FACES[high]) if signs >> i & 1)
            far = sum(1 << (c - shift) for i, c in enumerate(FACES[high]) if signs >> i & 1)
            here = segments(near, bit << high).get(high, [])
            there = segments(far, bit << low).get(low, [])
            named = {(_ends(a, shift), _ends(b, shift)) for a, b in here}
            assert named == {(_ends(b, 0), _ends(a, 0)) for a, b in there}


def _ends(edge, shift):
    return tuple(c - shift for c in EDGES[edge])


def test_single_corners_look_towards_the_outside():
    for corner in range(8):
        for case in (1 << corner, 255 ^ 1 << corner):
            (t,) = triangles(cases().entry[case, 0])
            a, b, c = (np.add(*(np.array(CORNERS[k]) for k in EDGES[e])) / 2 for e in t)
            outward = np.cross(b - a, c - a) @ (a - np.array(CORNERS[corner]))
            assert (outward > 0) == inside(case, corner)


def test_fifteen_cases_up_to_rotation_and_complement():
    """The historic table: 15 cases, at most five triangles each."""
    turns = _rotations()
    kinds = {}
    for case in range(256):
        orbit = []
        for turn in turns:
            image = sum(1 << turn[c] for c in range(8) if inside(case, c))
            orbit += [image, 255 - image]
        kinds.setdefault(min(orbit), []).append(case)
    assert len(kinds) == 15
    for members in kinds.values():
        counts = {len(triangles(cases().historic[c])) for c in members}
        assert len(counts) == 1
        assert max(counts) <= 5
    assert historic_bits(0b11111001) == ambiguous_faces(0b11111001)


def _rotations():
    found = []
    for axes in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
        even = axes in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        for flips in range(8):
            if (flips.bit_count() % 2 == 0) == even:
                turn = []
                for corner in CORNERS:
                    moved = [corner[a] ^ (flips >> i & 1) for i, a in enumerate(axes)]
                    turn.append(moved[0] + 2 * moved[1] + 4 * moved[2])
                found.append(turn)
    return found
