"""Writes the commands of meshcat's viewer: the packed messages that draw a scene and play its flight.

The messages are those of meshcat's Python package, which is not imported: with its web server, zmq and IPython the
import takes a third of a second, and its packer is written in Python.
"""

from __future__ import annotations

import base64
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from robochoc.flight.layout import Point
from robochoc.view.meshes import TriangleMesh
from robochoc.view.palette import Colour


class Track(NamedTuple):
    """The changes of a property (`position`, `quaternion`, `material.color`) of the object at `path`, by frame."""

    path: str
    name: str
    type: str
    keys: Sequence[tuple[float, Sequence[float]]]


_FRONT, _BOTH = 0, 2
"""The visible sides of faces, as three.js numbers them."""
_METADATA = {"version": 4.5, "type": "Object"}
"""The format of objects in three.js."""
_IDENTITY = np.eye(4).ravel().tolist()
_ARRAYS = {np.uint8: ("Uint8Array", 0x12), np.uint32: ("Uint32Array", 0x16), np.float32: ("Float32Array", 0x17)}
"""The name of a typed array in JavaScript, and the code of its extension type in the messages."""

_encode = msgspec.msgpack.Encoder().encode
_single = struct.Struct(">cf").pack


class MeshcatCommands:
    """Draws into `commands`: the packed messages for meshcat's viewer, in order.

    Paths are meshcat's: names joined by `/`, below `/meshcat` unless they begin with `/`. The same calls create the
    same bytes.
    """

    def __init__(self) -> None:
        self.commands: list[bytes] = []

    def mesh(
        self, path: str, shape: TriangleMesh, colour: Colour, opacity: float = 1, *, one_sided: bool = False
    ) -> None:
        """Draw a solid at `path`. Its faces are flat, its colours are its shades times `colour`.

        If it is `one_sided`, a face is visible only from the side from which its corners lie counterclockwise.
        """
        # Bytes, where they suffice, halve the size of every drone.
        index = np.uint8 if len(shape.vertices) <= np.iinfo(np.uint8).max else np.uint32
        attributes = {
            "position": _array(shape.vertices.astype(np.float32)),
            "color": _array(np.rint(255 * shape.colours).astype(np.uint8), is_normalized=True),  # 255 means 1
        }
        material = _material(
            "MeshPhongMaterial", colour, opacity, side=_FRONT if one_sided else _BOTH, has_colours=True
        )
        material |= {"flatShading": True, "depthWrite": opacity == 1}
        self._set_object(path, "Mesh", {"attributes": attributes, "index": _array(shape.faces.astype(index))}, material)

    def segments(self, path: str, points: npt.NDArray[np.float64], colour: Colour, opacity: float = 1) -> None:
        """Draw thin lines at `path`. Each pair of the N x 3 `points` has the ends of one line."""
        material = _material("LineBasicMaterial", colour, opacity, side=_BOTH, has_colours=False)
        material["depthWrite"] = False
        self._set_object(
            path, "LineSegments", {"attributes": {"position": _array(points.astype(np.float32))}}, material
        )

    def sprite(self, path: str, svg: str) -> None:
        """Draw a picture at `path`, one unit wide and high. It faces the viewer, and nothing covers it."""
        picture = f"data:image/svg+xml;base64,{base64.b64encode(svg.encode()).decode()}"
        material = {"uuid": "material", "type": "SpriteMaterial", "map": "texture", "transparent": True}
        sprite = {
            "metadata": _METADATA,
            "geometries": [],
            "images": [{"uuid": "image", "url": picture}],
            "textures": [{"uuid": "texture", "image": "image"}],
            "materials": [{**material, "depthWrite": False, "depthTest": False}],
            "object": {"uuid": f"{path} object", "type": "Sprite", "material": "material"},
        }
        self._store({"type": "set_object", "path": _absolute(path), "object": sprite})

    def place(self, path: str, at: Point = (0, 0, 0), size: Point = (1, 1, 1)) -> None:
        """Move the object at `path` to `at`, and scale it to `size`."""
        matrix = np.diag([*size, 1.0])
        matrix[3, :3] = at
        self._store({"type": "set_transform", "path": _absolute(path), "matrix": matrix.ravel().tolist()})

    def set(self, path: str, name: str, value: object) -> None:
        """Set a property of the object at `path`, by its name in three.js."""
        self._store({"type": "set_property", "path": _absolute(path), "property": name, "value": value})

    def animate(self, tracks: Sequence[Track], fps: int) -> None:
        """Play `tracks` once, all at the same time, and stop at their end. Keys are in the order of their frames."""
        clips: dict[str, list[dict[str, Any]]] = {}
        for track in tracks:
            keys = [{"time": _packed(at), "value": [*map(_packed, value)]} for at, value in track.keys]
            clips.setdefault(track.path, []).append({"name": f".{track.name}", "type": track.type, "keys": keys})
        animations = [
            {"path": _absolute(path), "clip": {"fps": fps, "name": "default", "tracks": clip}}
            for path, clip in clips.items()
        ]
        options = {"play": True, "repetitions": 1}
        self._store({"type": "set_animation", "animations": animations, "options": options, "path": ""})

    def _set_object(self, path: str, kind: str, data: dict[str, Any], material: dict[str, Any]) -> None:
        # Ids from paths, not random ids, make the bytes of every run the same.
        geometry = {"uuid": f"{path} geometry", "type": "BufferGeometry", "data": data}
        drawn = {
            "metadata": _METADATA,
            "geometries": [geometry],
            "materials": [{"uuid": f"{path} material", **material}],
            "object": {
                "uuid": f"{path} object",
                "type": kind,
                "geometry": geometry["uuid"],
                "material": f"{path} material",
                "matrix": _IDENTITY,
            },
        }
        self._store({"type": "set_object", "object": drawn, "path": _absolute(path)})

    def _store(self, message: dict[str, Any]) -> None:
        self.commands.append(_encode(message))


def _absolute(path: str) -> str:
    return path if path.startswith("/") else f"/meshcat/{path}" if path else "/meshcat"


def _array(rows: npt.NDArray[Any], *, is_normalized: bool = False) -> dict[str, Any]:
    name, code = _ARRAYS[rows.dtype.type]
    content = msgspec.msgpack.Ext(code, rows.tobytes())
    return {"itemSize": rows.shape[1], "type": name, "array": content, "normalized": is_normalized}


def _material(kind: str, colour: Colour, opacity: float, *, side: int, has_colours: bool) -> dict[str, Any]:
    return {
        "type": kind,
        "color": _hex(colour),
        "reflectivity": 0.5,
        "side": side,
        "transparent": opacity != 1,
        "opacity": opacity,
        "linewidth": 1.0,
        "wireframe": False,
        "wireframeLinewidth": 1.0,
        "vertexColors": 2 if has_colours else 0,
    }


def _packed(number: object) -> object:
    """Return a number of a key frame: there are many of them, and single precision is sufficient for display."""
    return msgspec.Raw(_single(b"\xca", number)) if isinstance(number, float) else number


def _hex(colour: Colour) -> int:
    red, green, blue = (round(255 * part) for part in colour)
    return red << 16 | green << 8 | blue
