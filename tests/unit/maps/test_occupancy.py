"""Occupancy grids of ROS's map_server: what is free and what is occupied, and what is refused."""

from __future__ import annotations

import os
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import InvalidInputError
from robochoc.formats.diagnostics import MistakeError
from robochoc.maps.occupancy.grid import MAX_YAML, read_occupancy_grid
from robochoc.maps.occupancy.pgm import MAX_PIXELS, read_pgm
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.maps import write_map

YAML = "image: plan.pgm\nresolution: 0.5\norigin: [1, -2.5, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"


def test_plain_and_raw_images_are_read_with_their_comments() -> None:
    wanted = [[0, 7, 255], [1, 2, 3]]
    plain, white = read_pgm(b"P2 # a comment\n# another\n3\t2\n255\n0 7 255\n# between rows\n1 2 3\n")
    assert (plain.tolist(), white) == (wanted, 255)
    raw, _ = read_pgm(b"P5\n#CREATOR: map_saver 0.050 m/pix\n3 2\n255\n" + bytes([0, 7, 255, 1, 2, 3]))
    assert raw.tolist() == wanted
    # The first pixel may look like a blank or a comment.
    assert read_pgm(b"P5 2 1 255\n\n#")[0].tolist() == [[10, 35]]
    wide, white = read_pgm(b"P5 2 1 1000\n\x03\xe8\x00\x01")
    assert (wide.tolist(), white) == ([[1000, 1]], 1000)


@looped(
    ("content", "said"),
    [
        (b"", "is not a PGM image"),
        (b"\x89PNG\r\n", "is not a PGM image"),
        (b"P6 1 1 255 abc", "is not a PGM image"),
        (b"P2 2 1 255\n1 2 3", "has data after its 2 pixels"),
        (b"P5 2 1 255\n12\n3", "has data after its 2 pixels"),
        (b"P5", "has no width"),
        (b"P5 2", "has no height"),
        (b"P5 2 2 # 255", "has no value of white"),
        (b"P5" + b"#" * 100_000 + b"\n1 1 255 1", "has no width"),
        (b"P5 0 2 255 ", "has the width '0'"),
        (b"P5 -1 2 255 ", "has the width '-1'"),
        (b"P5 99999999999 1 255 ", "has the width '99999999999'"),
        (b"P5 2001 2001 255 ", "has 2001 x 2001 pixels"),
        (b"P5 2 2 65536 ", "has the value of white '65536'"),
        (b"P5 2 2 255 abc", "ends after 3 of 4 pixels"),
        (b"P5 2 2 256 abcde", "ends after 2 of 4 pixels"),
        (b"P5 1 1 7 \x08", "has a pixel of 8"),
        (b"P2 2 2 255 1 2 3", "ends after 3 of 4 pixels"),
        (b"P2 2 1 255 1 256", "has the pixel '256'"),
        (b"P2 2 1 255 1 " + b"9" * 1_000_000, "has the pixel"),
        ("P2 2 1 255 1 ٣".encode(), "has the pixel"),
    ],
)
def test_other_images_are_refused(content: bytes, said: str) -> None:
    with pytest.raises(MistakeError, match=said) as refused:
        read_pgm(content)
    assert len(str(refused.value)) < 200
    assert refused.value.hint


@given(st.binary(max_size=60), st.sampled_from([b"P2", b"P5", b"P5 2 2 9\n", b"P2 2 2 9\n", b""]))
@examples(300)
def test_whatever_is_in_a_file_is_an_image_or_refused(content: bytes, begin: bytes) -> None:
    try:
        pixels, white = read_pgm(begin + content)
    except MistakeError:
        return
    assert 1 <= pixels.size <= MAX_PIXELS
    assert 0 <= pixels.min() <= pixels.max() <= white


@looped("negate", [False, True])
@looped(
    "thresholds",
    [
        ("0.65", "0.25"),
        ("0.6", "0.2"),
        ("0.65", "0.196"),
        ("1", "0"),
        ("0.2", "0.2"),
        # As programs write doubles. In units of 1e-17 a shade does not fit into 64 bits.
        ("0.6509803921568628", "0.19607843137254902"),
        ("0.65", "1.0e-300"),
    ],
)
def test_thresholds_are_those_of_map_server(tmp_path: Path, thresholds: tuple[str, str], *, negate: bool) -> None:
    """0.2 and 0.6 are exactly shades 204 and 102: what meets a threshold is neither more nor less."""
    path = tmp_path / "plan.yaml"
    text = YAML.replace("negate: 0", f"negate: {int(negate)}")
    path.write_text(text.replace("0.65", thresholds[0]).replace("0.25", thresholds[1]))
    (tmp_path / "plan.pgm").write_bytes(b"P5 256 1 255\n" + bytes(range(256)))
    grid = read_occupancy_grid(path)
    occupancy = [Fraction(shade if negate else 255 - shade, 255) for shade in range(256)]
    assert grid.occupied[0].tolist() == [one > Fraction(thresholds[0]) for one in occupancy]
    assert grid.free[0].tolist() == [one < Fraction(thresholds[1]) for one in occupancy]


def test_the_lowest_row_comes_first(tmp_path: Path) -> None:
    grid = read_occupancy_grid(write_map(tmp_path, ["#?.", "..#"], resolution="0.05", origin="[-10.0, 2, 0.0]"))
    assert grid.name == "plan"
    assert [grid.resolution, *grid.origin] == [Fraction(1, 20), Fraction(-10), Fraction(2)]
    assert np.array_equal(grid.free, [[True, True, False], [False, False, True]])
    assert np.array_equal(grid.occupied, [[False, False, True], [True, False, False]])


@pytest.mark.parametrize("mode", ["trinary", "scale"])
def test_modes_in_which_free_means_free_are_read(tmp_path: Path, mode: str) -> None:
    path = write_map(tmp_path, [".#"])
    path.write_text(f"mode: {mode}\n{path.read_text()}")
    assert read_occupancy_grid(path).free.tolist() == [[True, False]]


@looped(
    ("old", "new", "said"),
    [
        ("image: plan.pgm\n", "", "plan.yaml:1: the map has no image"),
        ("plan.pgm", "[plan]", "plan.yaml:1: has an image that is not a path"),
        ("plan.pgm", "other.pgm", "plan.yaml:1: names the image other.pgm, which does not exist .*folder of this file"),
        (YAML, f"P2 1 1 255 1{' ' * MAX_YAML}", "plan.yaml: is an image .*name the YAML file"),
        ("0.5", "0", "plan.yaml:2: has an invalid resolution .*from 0.001 to 100"),
        ("0.5", "much", "plan.yaml:2: has an invalid resolution"),
        ("0.5", "true", "plan.yaml:2: has an invalid resolution"),
        ("0.5", ".inf", "plan.yaml:2: has an invalid resolution"),
        ("[1, -2.5, 0]", "[1, 2]", "plan.yaml:3: has an origin that is not a pose"),
        ("[1, -2.5, 0]", "[1, 2, 1001]", "plan.yaml:3: has an invalid yaw .*from -1000 to 1000"),
        ("[1, -2.5, 0]", "[1e12, 2, 0]", "plan.yaml:3: has an invalid origin"),
        ("negate: 0", "negate: 2", "plan.yaml:4: has a negate"),
        ("0.65", "1.5", "plan.yaml:5: has an invalid occupied_thresh"),
        ("0.25", "0.7", "plan.yaml:6: has an invalid free_thresh .*from 0 to 0.65"),
        ("negate: 0", "negate: 0\nmode: [raw]", "plan.yaml:5: has a list or mapping as its mode .*supported modes:"),
        ("negate: 0", "negate: 0\nmode: rare", "plan.yaml:5: has the mode rare .*supported modes: trinary, scale, raw"),
        ("negate: 0", "negate: 0\nnegate: 1", "plan.yaml:5: duplicate key 'negate'"),
        ("negate: 0", "negate: !!python/object:os.system 0", "plan.yaml:4: the tag"),
        ("negate: 0", "negate: 0\nmood: raw", "plan.yaml:5: unknown key 'mood' .*did you mean 'mode'"),
        ("negate: 0", "negate: 0\nmode:\n- raw", "plan.yaml:6: has a list or mapping"),
        ("negate: 0", "negate: {", "plan.yaml:.*is not YAML"),
        (YAML, "- 1\n", "plan.yaml:1: is not a map"),
        (YAML, "#" * (MAX_YAML + 1), "plan.yaml: is too large"),
        (YAML, "\udcff", "plan.yaml: is not text in UTF-8"),
    ],
)
def test_other_descriptions_are_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    write_map(tmp_path, [".#"])
    path = tmp_path / "plan.yaml"
    assert old in YAML
    path.write_text(YAML.replace(old, new, 1), errors="surrogateescape")
    with pytest.raises(InvalidInputError, match=said):
        read_occupancy_grid(path)


def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    path = write_map(tmp_path, [".#"])
    (tmp_path / "plan.pgm").unlink()
    os.mkfifo(tmp_path / "plan.pgm")
    with pytest.raises(InvalidInputError, match=r"plan.pgm: is not a file"):
        read_occupancy_grid(path)
    with pytest.raises(InvalidInputError, match="is not a file"):
        read_occupancy_grid(tmp_path)
