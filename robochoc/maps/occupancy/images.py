"""Images of maps, as written by map_saver: PGM, PNG and BMP.

map_server uses the mean of a pixel's channels. Here the value of a pixel is the sum of its channels, and white is the
sum for a white pixel, so that nothing is rounded.
"""

from __future__ import annotations

import io
import struct
import warnings
import zlib

import numpy as np
import numpy.typing as npt
from PIL import Image as Pillow
from PIL import UnidentifiedImageError

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.maps.occupancy.pgm import MAX_PIXELS, Pixels, read_pgm
from robochoc.system.lazy_dataclass import dataclass

_PGM = (b"P2", b"P5")
_OTHERS = {b"\x89PNG\r\n\x1a\n": "PNG", b"BM": "BMP"}
_WIDE = 65_535
_ONE_BYTE = 255
_BROKEN = (OSError, SyntaxError, ValueError, EOFError, IndexError, KeyError, TypeError, OverflowError, struct.error)


@dataclass(frozen=True, eq=False)
class Image:
    """An image of a map.

    Attributes:
        pixels: The sum of each pixel's channels, in rows from the top.
        white: The sum for a white pixel. 0 is black.
        opaque: Which pixels are opaque. None: all pixels.
    """

    pixels: Pixels
    white: int
    opaque: npt.NDArray[np.bool_] | None = None


def is_image(content: bytes) -> bool:
    """Return whether the content of a file is an image in a supported format."""
    return content.startswith((*_PGM, *_OTHERS))


def read_image(content: bytes, *, adds_alpha: bool) -> Image:
    """Return the image in a file.

    Args:
        content: The content of the file.
        adds_alpha: True if alpha counts as a channel, as in map_server's mode trinary.

    Raises:
        MistakeError: The image has another format, is damaged, or has more than `MAX_PIXELS`.
    """
    if content[:2] in _PGM:
        return Image(*read_pgm(content))
    for magic, name in _OTHERS.items():
        if content.startswith(magic):
            return _read_other(content, name, adds_alpha=adds_alpha)
    raise MistakeError("is not a PGM, PNG or BMP image", "convert it to one of these, as written by map_saver")


def _read_other(content: bytes, name: str, *, adds_alpha: bool) -> Image:
    """Return an image decoded by Pillow, after checking its size."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's limit on pixels is above ours
            with Pillow.open(io.BytesIO(content), formats=(name,)) as opened:
                width, height = opened.size
                if width * height > MAX_PIXELS or min(width, height) < 1:
                    raise MistakeError(
                        f"has {width} x {height} pixels", f"at most {MAX_PIXELS:,} are read; use a coarser map"
                    )
                return _summed(opened, adds_alpha=adds_alpha)
    except Pillow.DecompressionBombError:
        hint = f"at most {MAX_PIXELS:,} are read; use a coarser map"
        raise MistakeError("has too many pixels", hint) from None
    except (*_BROKEN, zlib.error) as error:
        reason = "" if isinstance(error, UnidentifiedImageError) else f": {shortened(str(error))}"
        raise MistakeError(f"is a damaged {name} image{reason}", "save the image again") from None


def _summed(opened: Pillow.Image, *, adds_alpha: bool) -> Image:
    """Return the sums of channels."""
    if opened.mode.startswith("I"):
        return _wide(opened)
    if opened.mode == "P" and opened.palette is None:
        raise ValueError("its palette is missing")
    if not opened.has_transparency_data:
        grey = opened.mode in {"1", "L"}
        channels = np.asarray(opened.convert("L" if grey else "RGB"))
        return Image(_sum(channels) if channels.ndim > 2 else channels.astype(np.int64), _white(channels))  # noqa: PLR2004
    channels = np.asarray(opened.convert("RGBA"))
    if adds_alpha:
        return Image(_sum(channels), _white(channels))
    return Image(_sum(channels[..., :3]), 3 * _ONE_BYTE, channels[..., 3] == _ONE_BYTE)


def _wide(opened: Pillow.Image) -> Image:
    """Return a greyscale image with two bytes per pixel."""
    pixels = np.asarray(opened).astype(np.int64)
    if not 0 <= pixels.min() <= pixels.max() <= _WIDE:
        raise MistakeError("has shades of grey of more than two bytes", "convert it to one byte a pixel")
    return Image(pixels, _WIDE)


def _sum(channels: npt.NDArray[np.uint8]) -> Pixels:
    found: Pixels = channels.sum(axis=2, dtype=np.int64)
    return found


def _white(channels: npt.NDArray[np.uint8]) -> int:
    return _ONE_BYTE * (channels.shape[2] if channels.ndim > 2 else 1)  # noqa: PLR2004 - rows, columns, channels
