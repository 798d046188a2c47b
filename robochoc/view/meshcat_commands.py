"""Commands for meshcat's viewer: packed messages that draw, move and animate objects.

The viewer is a script (`page_scripts.py`). meshcat's Python package is not used, since it starts a server, and brings
IPython and zmq. A message is a map in MessagePack; objects are in the JSON format of three.js, with arrays as
extension types.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any, NamedTuple

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
"""The visible sides of faces, as numbered by three.js."""
_BY_VERTEX = 2
"""Colours of vertices, as the viewer's three.js numbers them."""
_ARRAYS = {"uint8": ("Uint8Array", 0x12), "uint32": ("Uint32Array", 0x16), "float32": ("Float32Array", 0x17)}
"""Types of numbers: JavaScript's array, and the viewer's code of the extension type."""
_IDENTITY = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]


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
        """Draw a solid with flat faces at `path`. Its colours are its shades multiplied by `colour`.

        If `one_sided`, a face is visible only from the side on which its corners are counterclockwise.
        """
        # Using bytes where possible halves the size of every drone.
        few = len(shape.vertices) <= np.iinfo(np.uint8).max
        material = {
            **_material(path, "MeshPhongMaterial", colour, opacity, side=_FRONT if one_sided else _BOTH),
            "vertexColors": _BY_VERTEX,
            "flatShading": True,
            "depthWrite": opacity == 1,
        }
        attributes = {
            "position": _packed(shape.vertices.astype(np.float32)),
            "color": _packed(np.rint(255 * shape.colours).astype(np.uint8)) | {"normalized": True},  # 255 means 1
        }
        index = _packed(shape.faces.astype(np.uint8 if few else np.uint32))
        self._draw(path, "Mesh", {"attributes": attributes, "index": index}, material)

    def segments(self, path: str, points: npt.NDArray[np.float64], colour: Colour, opacity: float = 1) -> None:
        """Draw thin lines at `path`. Each pair of rows in `points` (N, 3) has the ends of one line."""
        material = {**_material(path, "LineBasicMaterial", colour, opacity, side=_BOTH), "depthWrite": False}
        attributes = {"position": _packed(points.astype(np.float32))}
        self._draw(path, "LineSegments", {"attributes": attributes}, material)

    def sprite(self, path: str, svg: str) -> None:
        """Draw a picture at `path`, one unit wide and high, which faces the viewer and is never covered."""
        picture = f"data:image/svg+xml;base64,{base64.b64encode(svg.encode()).decode()}"
        material = {"uuid": "material", "type": "SpriteMaterial", "map": "texture", "transparent": True}
        sprite = {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [],
            "images": [{"uuid": "image", "url": picture}],
            "textures": [{"uuid": "texture", "image": "image"}],
            "materials": [{**material, "depthWrite": False, "depthTest": False}],
            "object": {"uuid": f"{path} object", "type": "Sprite", "material": "material"},
        }
        self._store({"type": "set_object", "path": _full(path), "object": sprite})

    def place(self, path: str, at: Point = (0, 0, 0), size: Point = (1, 1, 1)) -> None:
        """Move the object at `path` to `at`, and scale it to `size`."""
        matrix = np.diag([*size, 1.0])
        matrix[:3, 3] = at
        self._store({"type": "set_transform", "path": _full(path), "matrix": matrix.T.flatten().tolist()})

    def set(self, path: str, name: str, value: object) -> None:
        """Set a property of the object at `path`, by its name in three.js."""
        self._store({"type": "set_property", "path": _full(path), "property": name, "value": value})

    def animate(self, tracks: Sequence[Track], fps: int) -> None:
        """Play `tracks` once, all at the same time, and stop at their end. Each path has one track of a property."""
        clips: dict[str, list[dict[str, Any]]] = {}
        for track in tracks:
            keys = [{"time": time, "value": list(value)} for time, value in sorted(track.keys, key=lambda key: key[0])]
            clips.setdefault(_full(track.path), []).append({"name": f".{track.name}", "type": track.type, "keys": keys})
        animations = [
            {"path": path, "clip": {"fps": fps, "name": "default", "tracks": found}} for path, found in clips.items()
        ]
        options = {"play": True, "repetitions": 1}
        self._store({"type": "set_animation", "animations": animations, "options": options, "path": ""})

    def _draw(self, path: str, kind: str, data: dict[str, Any], material: dict[str, Any]) -> None:
        names = {part: f"{path} {part}" for part in ("object", "geometry", "material")}
        drawn = {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [{"uuid": names["geometry"], "type": "BufferGeometry", "data": data}],
            "materials": [material],
            "object": {
                "uuid": names["object"],
                "type": kind,
                "geometry": names["geometry"],
                "material": names["material"],
                "matrix": _IDENTITY,
            },
        }
        self._store({"type": "set_object", "object": drawn, "path": _full(path)})

    def _store(self, message: dict[str, Any]) -> None:
        import umsgpack  # noqa: PLC0415 - start-up: needed only when a scene is drawn

        # There are many key frames, and single precision is sufficient for display.
        precision = "single" if message["type"] == "set_animation" else "double"
        self.commands.append(umsgpack.packb(message, force_float_precision=precision))


def _full(path: str) -> str:
    return path if path.startswith("/") else "/meshcat" + (f"/{path}" if path else "")


def _material(path: str, kind: str, colour: Colour, opacity: float, *, side: int) -> dict[str, Any]:
    red, green, blue = (round(255 * part) for part in colour)
    return {
        "uuid": f"{path} material",
        "type": kind,
        "color": red << 16 | green << 8 | blue,
        "side": side,
        "transparent": opacity != 1,
        "opacity": opacity,
    }


def _packed(rows: npt.NDArray[Any]) -> dict[str, Any]:
    """Return an attribute of N vertices, or N faces, with three numbers each."""
    import umsgpack  # noqa: PLC0415 - the same

    name, code = _ARRAYS[rows.dtype.name]
    return {"itemSize": 3, "type": name, "array": umsgpack.Ext(code, rows.tobytes()), "normalized": False}
