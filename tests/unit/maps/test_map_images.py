"""Images of maps other than PGM, modes, and what is refused of them."""

from __future__ import annotations

import io
import struct
import zlib
from fractions import Fraction
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image as Pillow

from robochoc.formats import InvalidInputError
from robochoc.formats.diagnostics import MistakeError
from robochoc.maps.occupancy.grid import OccupancyGrid, read_occupancy_grid
from robochoc.maps.occupancy.images import read_image
from robochoc.maps.occupancy.pgm import MAX_PIXELS
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.maps import write_map

_PALETTE = 3
"""PNG's type of colour where pixels are places in a palette."""
SHADES = np.arange(256, dtype=np.uint8).reshape(16, 16)


def encoded(image: Pillow.Image, kind: str = "PNG") -> bytes:
    stream = io.BytesIO()
    image.save(stream, kind)
    return stream.getvalue()


def read(folder: Path, image: bytes, mode: str = "trinary", negate: int = 0) -> OccupancyGrid:
    path = write_map(folder, [".#"])
    path.write_text(f"mode: {mode}\n" + path.read_text().replace("negate: 0", f"negate: {negate}"))
    (folder / "plan.pgm").write_bytes(image)
    return read_occupancy_grid(path)


@looped("kind", ["PNG", "BMP"])
@looped("mode", ["L", "RGB", "P", "1"])
def test_an_image_means_what_the_same_one_as_pgm_means(tmp_path: Path, kind: str, mode: str) -> None:
    shades = SHADES if mode != "1" else np.where(SHADES > 100, 255, 0).astype(np.uint8)
    image = Pillow.fromarray(shades).convert(mode)
    found = read(tmp_path, encoded(image, kind))
    wanted = read(tmp_path, b"P5 16 16 255\n" + shades.tobytes())
    assert np.array_equal(found.free, wanted.free)
    assert np.array_equal(found.occupied, wanted.occupied)
    assert wanted.free.any()
    assert wanted.occupied.any()


def test_a_pixel_is_the_mean_of_its_channels() -> None:
    colours = np.array([[[255, 0, 1], [2, 2, 2]]], dtype=np.uint8)
    image = read_image(encoded(Pillow.fromarray(colours)), adds_alpha=True)
    assert (image.pixels.tolist(), image.white) == ([[256, 6]], 765)
    wide = np.array([[0, 65_535, 256]], dtype=np.uint16)
    image = read_image(encoded(Pillow.fromarray(wide)), adds_alpha=True)
    assert (image.pixels.tolist(), image.white) == ([[0, 65_535, 256]], 65_535)


def test_alpha_is_a_channel_in_the_mode_trinary_alone(tmp_path: Path) -> None:
    """As map_server has it: an opaque 205 is then free, and what is not opaque is not known in the mode scale."""
    colours = [[205, 205, 205, 255], [0, 0, 0, 255], [254, 254, 254, 255], [254, 254, 254, 50], [0, 0, 0, 0]]
    image = encoded(Pillow.fromarray(np.array([colours], dtype=np.uint8)))
    for mode, free, occupied in (
        ("trinary", [True, False, True, False, False], [False, True, False, False, True]),
        ("scale", [False, False, True, False, False], [False, True, False, False, False]),
    ):
        grid = read(tmp_path, image, mode)
        assert (grid.free[0].tolist(), grid.occupied[0].tolist()) == (free, occupied)


def test_raw_shades_are_percents(tmp_path: Path) -> None:
    for image in (b"P5 256 1 255\n" + bytes(range(256)), encoded(Pillow.fromarray(SHADES.reshape(1, 256)))):
        grid = read(tmp_path, image, "raw")
        percents = [Fraction(shade, 100) if shade <= 100 else Fraction(1, 2) for shade in range(256)]
        assert grid.free[0].tolist() == [percent < Fraction("0.196") for percent in percents]
        assert grid.occupied[0].tolist() == [percent > Fraction("0.65") for percent in percents]
    wide = Pillow.fromarray(np.array([[0, 257 * 19, 257 * 20, 257 * 66, 65_535]], dtype=np.uint16))
    grid = read(tmp_path, encoded(wide), "raw")
    assert grid.free[0].tolist() == [True, True, False, False, False]
    assert grid.occupied[0].tolist() == [False, False, False, True, False]


def test_raw_is_not_negated(tmp_path: Path) -> None:
    """ROS 1 would, and Nav2 would not."""
    with pytest.raises(InvalidInputError, match=r"plan.yaml:5: has negate 1 in the mode raw"):
        read(tmp_path, b"P5 1 1 255\n\0", "raw", 1)


def chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def png(width: int, height: int, content: bytes, colour: int = 0) -> bytes:
    head = struct.pack(">IIBBBBB", width, height, 8, colour, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", content) + chunk(b"IEND", b"")


@looped(
    ("content", "said"),
    [
        (b"", "is not a PGM, PNG or BMP image"),
        (b"GIF89a", "is not a PGM, PNG or BMP image"),
        (png(2001, 2001, b""), "has 2001 x 2001 pixels"),
        (png(2**31 - 1, 2**31 - 1, b""), "has .* pixels"),
        (png(20_000, 20_000, b""), "has .* pixels"),
        (png(0, 2, b""), "is a damaged PNG|has 0 x 2 pixels"),
        (png(2, 2, b"nonsense"), "is a damaged PNG"),
        (png(2, 2, zlib.compress(bytes(6)))[:-30], "is a damaged PNG"),
        (png(1, 1, zlib.compress(bytes(2)), _PALETTE), "is a damaged PNG image: its palette is missing"),
        (b"\x89PNG\r\n\x1a\n", "is a damaged PNG"),
        (b"BM" + bytes(100), "is a damaged BMP"),
    ],
)
def test_broken_images_and_bombs_are_refused(content: bytes, said: str) -> None:
    with pytest.raises(MistakeError, match=said) as refused:
        read_image(content, adds_alpha=True)
    assert len(str(refused.value)) < 200
    assert "object at" not in str(refused.value)
    assert refused.value.hint


def test_compressed_pixels_beyond_the_size_are_not_unpacked() -> None:
    image = read_image(png(2, 2, zlib.compress(bytes(50_000_000))), adds_alpha=True)
    assert image.pixels.tolist() == [[0, 0], [0, 0]]


@given(st.integers(0, 2**32), st.sampled_from(["PNG", "BMP"]), st.sampled_from(["L", "RGBA", "P", "1"]))
@examples(300)
def test_damaged_images_are_read_or_refused(seed: int, kind: str, mode: str) -> None:
    chance = Random(seed)
    content = bytearray(encoded(Pillow.fromarray(SHADES).convert(mode), kind))
    for _ in range(chance.randint(1, 6)):
        content[chance.randrange(2, len(content))] = chance.randrange(256)
    del content[chance.choice([chance.randrange(2, len(content)), len(content)]) :]
    try:
        image = read_image(bytes(content), adds_alpha=chance.random() < 0.5)
    except MistakeError:
        return
    assert 1 <= image.pixels.size <= MAX_PIXELS
    assert 0 <= image.pixels.min() <= image.pixels.max() <= image.white
