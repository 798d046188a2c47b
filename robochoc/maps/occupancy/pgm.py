"""Greyscale images in Netpbm's PGM format, plain (P2, text) or raw (P5), with one image per file.

A file has the magic number, the width, the height and the value of white as text, then the pixels row by row from the
top. A `#` begins a comment, which extends to the end of the line.
"""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from robochoc.formats.diagnostics import MistakeError, shortened

MAX_PIXELS = 4_000_000
"""The maximum number of pixels, 2,000 x 2,000."""
MAX_BYTES = 32 * 1024 * 1024
"""The maximum size of a file: a plain image has up to six characters per pixel."""
_WHITE_MAX = 65_535
_ONE_BYTE = 255
_HEADER_MAX = 64 * 1024
"""The maximum size of the comments and numbers before the pixels."""

_TOKEN = re.compile(rb"(?:\s|#[^\r\n]*+)*+([^\s#]+)")
_COMMENT = re.compile(rb"#[^\r\n]*")

Pixels = npt.NDArray[np.int64]


def read_pgm(content: bytes) -> tuple[Pixels, int]:
    """Return the pixels of an image, in rows from the top, and the value of white; 0 is black.

    Raises:
        MistakeError: The content is not a valid PGM image, or has more than `MAX_PIXELS`.
    """
    magic = content[:2]
    if magic not in {b"P2", b"P5"}:
        raise MistakeError("is not a PGM image", "a PGM image begins with P2 or P5; convert other images to PGM")
    place = len(magic)
    header = content[:_HEADER_MAX]
    numbers = []
    for what, most in (("width", MAX_PIXELS), ("height", MAX_PIXELS), ("value of white", _WHITE_MAX)):
        found = _TOKEN.match(header, place)
        if not found:
            raise MistakeError(f"has no {what}", "a PGM image begins with P2 or P5, width, height and value of white")
        numbers.append(_number(found[1], what, 1, most))
        place = found.end()
    width, height, white = numbers
    if width * height > MAX_PIXELS:
        raise MistakeError(f"has {width} x {height} pixels", f"at most {MAX_PIXELS:,} are read; use a coarser map")
    read = _plain if magic == b"P2" else _raw
    pixels = read(content, place, width * height, white)
    if int(pixels.max()) > white:
        raise MistakeError(f"has a pixel of {int(pixels.max())}", f"white, the largest value, is {white}")
    return pixels.reshape(height, width), white


def _raw(content: bytes, place: int, count: int, white: int) -> Pixels:
    """Return the pixels, which follow one whitespace character: a byte each, or two bytes if white needs two."""
    size = 1 if white <= _ONE_BYTE else 2
    end = place + 1 + count * size
    raster = content[place + 1 : end]
    if len(raster) < count * size:
        raise MistakeError(
            f"ends after {len(raster) // size} of {count} pixels", "the image is incomplete: save it again"
        )
    _check_end(content[end:], count)
    return np.frombuffer(raster, dtype=np.dtype(f">u{size}")).astype(np.int64)


def _plain(content: bytes, place: int, count: int, white: int) -> Pixels:
    """Return the pixels, given as numbers separated by whitespace."""
    words = _COMMENT.sub(b"", content[place:]).split(None, count)
    if len(words) < count:
        raise MistakeError(f"ends after {len(words)} of {count} pixels", "the image is incomplete: save it again")
    _check_end(b"".join(words[count:]), count)
    del words[count:]
    return np.fromiter((_number(word, "pixel", 0, white) for word in words), np.int64, count)


def _check_end(content: bytes, count: int) -> None:
    if content.strip():
        raise MistakeError(f"has data after its {count} pixels", "one file has one image: check the width and height")


def _number(word: bytes, what: str, least: int, most: int) -> int:
    if not word.isdigit() or len(word) > len(str(MAX_PIXELS)) or not least <= int(word) <= most:
        text = shortened(word.decode("ascii", "replace"))
        raise MistakeError(f"has the {what} '{text}'", f"expected a number from {least} to {most}")
    return int(word)
