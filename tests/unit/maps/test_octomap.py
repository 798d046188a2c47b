"""OctoMap's files: what is free, occupied and unknown, and what is refused."""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
from collections.abc import Callable
from fractions import Fraction
from itertools import product
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import InvalidInputError
from robochoc.formats.diagnostics import MistakeError
from robochoc.maps.map_file import read_map
from robochoc.maps.occupancy.grid import OccupancyGrid
from robochoc.maps.octomap import octree
from robochoc.maps.octomap.octree import read_octree
from robochoc.maps.octomap.voxels import VoxelGrid, read_voxels
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.limits import HANG_S
from tests.support.octomaps import FREE, MIDDLE, OCCUPIED, Voxel, Voxels, drawn_voxels, write_octomap
from tests.support.program import ROOT

HOUSE = ROOT / "docs/examples/house/house.bt"
BT, OT = b"# Octomap OcTree binary file\n", b"# Octomap OcTree file\n"
HEAD = b"# a comment\nid OcTree\nsize 2\nres 0.5\ndata\n"
SIDES = st.tuples(*[st.integers(1, 7)] * 3)
FIRST = st.tuples(*[st.integers(-9, 9) | st.sampled_from([-MIDDLE, MIDDLE - 8])] * 3)


def states_of(grid: VoxelGrid) -> dict[Voxel, int]:
    """Return what is known of voxels, by their places from the middle of the tree on."""
    first = [part / grid.resolution for part in grid.origin]
    assert all(part.denominator == 1 for part in first)
    found = {}
    for flags, kind in ((grid.free, FREE), (grid.occupied, OCCUPIED)):
        for z, y, x in np.argwhere(flags).tolist():
            found[int(first[0]) + x, int(first[1]) + y, int(first[2]) + z] = kind
    assert len(found) == grid.free.sum() + grid.occupied.sum()
    return found


def around_free(voxels: Voxels) -> dict[Voxel, int]:
    """Return what lies around free voxels, and one further."""
    free = [at for at, kind in voxels.items() if kind == FREE]
    ends = [(min(parts) - 1, max(parts) + 1) for parts in zip(*free, strict=True)]
    return {
        at: kind
        for at, kind in voxels.items()
        if all(low <= part <= high for part, (low, high) in zip(at, ends, strict=True))
    }


def joined(voxels: Voxels, side: int) -> dict[Voxel, int]:
    """Return cubes of voxels: free if all of one is, occupied if any is."""
    parts: dict[Voxel, list[int]] = {}
    for (x, y, z), kind in voxels.items():
        parts.setdefault((x // side, y // side, z // side), []).append(kind)
    found = {at: OCCUPIED for at, kinds in parts.items() if OCCUPIED in kinds}
    return found | {at: FREE for at, kinds in parts.items() if kinds.count(FREE) == side**3}


@given(SIDES, FIRST, st.integers(0, 2**32), st.sampled_from(["bt", "ot"]), st.sampled_from([0.0, 0.02, 0.3]))
@examples(80)
def test_a_tree_is_read_voxel_by_voxel(sides: Voxel, first: Voxel, seed: int, kind: str, walls: float) -> None:
    voxels = drawn_voxels(Random(seed), sides, first, walls)
    if FREE not in voxels.values():
        return
    with TemporaryDirectory() as folder:
        grid = read_voxels(write_octomap(Path(folder) / f"plan.{kind}", voxels, "0.1"))
    assert (grid.name, grid.resolution) == ("plan", Fraction(1, 10))
    assert states_of(grid) == around_free(voxels)


@given(SIDES, FIRST, st.integers(0, 2**32), st.integers(1, 400))
@examples(60)
def test_too_many_voxels_are_joined(sides: Voxel, first: Voxel, seed: int, most: int) -> None:
    voxels = drawn_voxels(Random(seed), sides, first, 0.02)
    if FREE not in voxels.values():
        return
    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr("robochoc.maps.octomap.voxels.MAX_VOXELS", most)
        try:
            grid = read_voxels(write_octomap(Path(folder) / "plan.bt", voxels, "0.1"))
        except InvalidInputError as error:
            told = re.search(r"and no free cube of (\S+) m", str(error))
            assert told
            assert FREE not in joined(voxels, int(Fraction(told[1]) * 10)).values()
            return
    side = int(grid.resolution / Fraction(1, 10))
    assert grid.free.size <= most
    found, wanted = states_of(grid), joined(voxels, side)
    assert {at for at, kind in found.items() if kind == FREE} == {at for at, kind in wanted.items() if kind == FREE}
    assert found.items() <= wanted.items()


def test_joined_leaves_and_single_ones_lie_together(tmp_path: Path) -> None:
    """A room of 24 x 32 x 17 voxels: leaves are as large as 16 voxels there."""
    voxels = {(x - 3, y + 5, z): FREE for x, y, z in product(range(24), range(32), range(17))}
    voxels |= {(x - 3, 12, z): OCCUPIED for x, z in product(range(24), range(17))}
    for name in ("plan.bt", "plan.ot"):
        path = write_octomap(tmp_path / name, voxels)
        leaves = read_octree(path.read_bytes()).leaves
        assert max(some.exponent for some in leaves if some.corners.size) == 4
        assert states_of(read_voxels(path)) == voxels


def test_the_whole_tree_may_be_one_leaf() -> None:
    tree = read_octree(OT + HEAD.replace(b"size 2", b"size 1") + struct.pack("<fB", -1.0, 0))
    assert [(leaves.exponent, leaves.corners.tolist()) for leaves in tree.leaves] == [(16, [[0, 0, 0]])]


def test_the_space_of_one_leaf_is_bounded(tmp_path: Path) -> None:
    path = tmp_path / "all.ot"
    path.write_bytes(OT + HEAD.replace(b"size 2", b"size 1") + struct.pack("<fB", -1.0, 0))
    grid = read_voxels(path)
    assert grid.free.size <= 16_000_000
    assert grid.free.all()
    assert grid.origin == tuple([-MIDDLE * Fraction(1, 2)] * 3)


def test_colours_are_read_over() -> None:
    node = struct.pack("<fBBBB", -1.0, 200, 100, 0, 0)
    head = b"# more\nres 5e-1\nid ColorOcTree\nsize  3 \n\ndata\n"
    tree = read_octree(OT + head + struct.pack("<fBBBB", 2.0, 1, 2, 3, 0b101) + node + node[:3] + b"?" + node[4:])
    assert tree.resolution == Fraction(1, 2)
    assert [leaves.corners.tolist() for leaves in tree.leaves if leaves.corners.size] == [[[0, 0, 0], [0, 1, 0]]]


def test_odds_that_are_no_number_are_not_known() -> None:
    nodes = struct.pack("<fB", 0, 7) + b"".join(struct.pack("<fB", odds, 0) for odds in (float("nan"), 0.0, -1e-9))
    (leaves,) = [
        leaves for leaves in read_octree(OT + HEAD.replace(b"size 2", b"size 4") + nodes).leaves if leaves.corners.size
    ]
    assert leaves.corners.tolist() == [[1, 0, 0], [0, 1, 0]]
    assert leaves.occupied.tolist() == [True, False]


CHAIN = b"\x03\x00"


@looped(
    ("content", "said"),
    [
        (b"", "is not an OctoMap file"),
        (b"\x03\x00\x00\x00 an old binary file", "is not an OctoMap file"),
        (BT, "has a header without end"),
        (BT + b"# id OcTree\n" * 10_000, "has a header without end"),
        (BT + b"id OcTree\n" * 2, "has the line 'id' twice in its header"),
        (BT + HEAD.replace(b"data", b"resolution 1\ndata"), "has the unknown line 'resolution' in its header"),
        (BT + HEAD.replace(b"2", b"0") + CHAIN, "has 2 bytes after its last node"),
        (BT + HEAD.replace(b"2", b"9") + b"\x01\x00 \n\xff\xff", "has 2 nodes, but its header states 9"),
        (BT + HEAD + b"\x01\x00 \n\xff\xff", "has 4 bytes after its last node"),
        (BT + b"id OcTree\nsize 1\ndata\n", "has no res in its header"),
        (BT + b"size 1\nres 1\ndata\n", "has no id in its header"),
        (BT + b"id OcTree\nres 1\ndata\n", "has no size in its header"),
        (BT + HEAD.replace(b"OcTree", b"CountingOcTree"), "has a tree of the type CountingOcTree"),
        (BT + HEAD.replace(b"0.5", b"0"), "has an invalid res"),
        (BT + HEAD.replace(b"0.5", b"nan"), "has an invalid res"),
        (BT + HEAD.replace(b"0.5", b"1e99"), "has an invalid res"),
        (BT + HEAD.replace(b"0.5", b""), "has an invalid res"),
        (BT + HEAD.replace(b"size 2", b"size -2"), "has an invalid size"),
        (BT + HEAD.replace(b"size 2", b"size 2.5"), "has an invalid size"),
        (BT + HEAD, "ends after 0 nodes"),
        (BT + HEAD + b"\x03", "ends after 0 nodes"),
        (BT + HEAD + CHAIN * 5, "ends after 5 nodes"),
        (BT + HEAD + b"\x00\x00", "has a node without children at byte 71"),
        (BT + HEAD + CHAIN + b"\x00\x00", "has a node without children at byte 73"),
        (BT + HEAD + CHAIN * 16 + b"\x01\x00", "has a node below level 16 at byte 103"),
        (BT + HEAD + b"\x05\x00", "has 3 nodes, but its header states 2"),
        (OT + HEAD + struct.pack("<fB", 1, 1), "ends after 1 nodes"),
        (OT + HEAD + struct.pack("<fB", 1, 0), "has 1 nodes, but its header states 2"),
        (OT + HEAD + struct.pack("<fBfB", 1, 1, 1, 0) + b"x", "has 1 bytes after its last node"),
        (OT + HEAD + struct.pack("<fB", 1, 1) * 17 + struct.pack("<fB", 1, 0), "has a node below level 16 at byte"),
    ],
)
def test_other_files_are_refused(content: bytes, said: str) -> None:
    with pytest.raises(MistakeError, match=said) as refused:
        read_octree(content)
    assert refused.value.hint


def test_a_file_is_named_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "plan.bt"
    path.write_bytes(BT + HEAD.replace(b"0.5", b"much"))
    with pytest.raises(InvalidInputError, match=r"plan.bt:5: has an invalid res .*from 0.001 to 100"):
        read_map(path)
    path.write_bytes(BT + HEAD.replace(b"size 2", b"size 0"))
    with pytest.raises(InvalidInputError, match=r"plan.bt: has no free voxel"):
        read_map(path)
    write_octomap(path, {(0, 0, 0): OCCUPIED})
    with pytest.raises(InvalidInputError, match=r"plan.bt: has no free voxel"):
        read_map(path)


def test_sizes_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_octomap(tmp_path / "plan.bt", drawn_voxels(Random(1), (4, 4, 4)))
    monkeypatch.setattr(octree, "MAX_NODES", 5)
    with pytest.raises(InvalidInputError, match="has more than 5 nodes"):
        read_voxels(path)
    monkeypatch.setattr("robochoc.maps.octomap.voxels.MAX_BYTES", 100)
    with pytest.raises(InvalidInputError, match="is too large"):
        read_voxels(path)


@given(st.integers(0, 2**32), st.sampled_from(["bt", "ot"]))
@examples(120)
def test_damaged_files_are_read_or_refused(seed: int, kind: str) -> None:
    chance = Random(seed)
    with TemporaryDirectory() as folder:
        path = write_octomap(Path(folder) / f"plan.{kind}", drawn_voxels(chance, (3, 3, 3), (-1, -1, -1)))
        content = bytearray(path.read_bytes())
        for _ in range(chance.randint(1, 4)):
            content[chance.randrange(len(content))] = chance.randrange(256)
        del content[chance.choice([chance.randrange(len(content)), len(content)]) :]
        path.write_bytes(content)
        try:
            tree = read_octree(path.read_bytes())
        except MistakeError:
            return
    assert sum(len(leaves.corners) for leaves in tree.leaves) <= 8 * len(content)
    for leaves in tree.leaves:
        assert ((leaves.corners >= 0) & (leaves.corners < 2 ** (16 - leaves.exponent))).all()


def test_a_map_is_known_by_how_its_file_begins(tmp_path: Path) -> None:
    assert isinstance(read_map(ROOT / "docs/examples/building/building.yaml"), OccupancyGrid)
    grid = read_map(HOUSE)
    assert isinstance(grid, VoxelGrid)
    assert grid.free.shape == (20, 26, 34)
    other = tmp_path / "named.yaml"
    other.write_bytes(HOUSE.read_bytes())
    assert isinstance(read_map(other), VoxelGrid)


needs_octomap = pytest.mark.skipif(shutil.which("convert_octree") is None, reason="octomap-tools are not installed")


@pytest.fixture
def convert(tmp_path: Path) -> Callable[[Path, str], Path]:
    """Return a function that has OctoMap's own tool convert a file."""

    def run(path: Path, ending: str) -> Path:
        made = tmp_path / f"{path.stem}-converted.{ending}"
        done = subprocess.run(
            ["convert_octree", path, made],
            capture_output=True,
            text=True,
            timeout=HANG_S,
            check=False,
        )
        assert made.is_file(), done.stderr
        return made

    return run


@needs_octomap
@pytest.mark.parametrize("seed", range(4))
def test_octomap_reads_what_is_read_here(tmp_path: Path, convert: Callable[[Path, str], Path], seed: int) -> None:
    """A tree that OctoMap has read and written in the other format means the same."""
    voxels = drawn_voxels(Random(seed), (9, 6, 5), (-4, -3, seed), 0.2)
    for begin, end in (("bt", "ot"), ("ot", "bt"), ("ot", "ot"), ("bt", "bt")):
        path = write_octomap(tmp_path / f"plan{begin}{end}.{begin}", voxels)
        grid = read_voxels(convert(path, end))
        assert states_of(grid) == around_free(voxels)
    grid, other = read_voxels(HOUSE), read_voxels(convert(HOUSE, "ot"))
    assert np.array_equal(grid.free, other.free)
    assert np.array_equal(grid.occupied, other.occupied)
