"""Uses meshcat without its server: collects the messages to it, packed for its viewer.

Only this module uses meshcat's Python package. It is imported when a scene is drawn, not before: with its web server,
zmq and IPython the import takes a third of a second. `Visualizer()` without arguments would start a server on all
interfaces; with a window object of ours, it only calls that.
"""

from __future__ import annotations

import base64
import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

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


class _Command(Protocol):
    """A command of meshcat: `lower` makes it a dict of plain values."""

    def lower(self) -> dict[str, Any]: ...


_FRONT, _BOTH = 0, 2
"""The visible sides of faces, as three.js numbers them."""


class MeshcatCommands:
    """Draws by meshcat into `commands`: the packed messages for its viewer, in order.

    Paths are meshcat's: names joined by `/`, below `/meshcat` unless they begin with `/`. The same calls create the
    same bytes.
    """

    def __init__(self) -> None:
        self.commands: list[bytes] = []
        self._meshcat = _meshcat()
        self._root = self._meshcat.Visualizer(window=self)

    def send(self, command: _Command) -> None:
        """Store a message from meshcat to its server. Called by meshcat."""
        self._store(command.lower())

    def mesh(
        self, path: str, shape: TriangleMesh, colour: Colour, opacity: float = 1, *, one_sided: bool = False
    ) -> None:
        """Draw a solid at `path`. Its faces are flat, its colours are its shades times `colour`.

        If it is `one_sided`, a face is visible only from the side from which its corners lie counterclockwise.
        """
        three = self._meshcat.geometry
        geometry = three.TriangularMeshGeometry(shape.vertices, shape.faces)
        # Bytes, where they suffice, halve the size of every drone.
        geometry.color = np.rint(255 * shape.colours).astype(np.uint8)
        if len(shape.vertices) <= np.iinfo(np.uint8).max:
            geometry.faces = shape.faces.astype(np.uint8)
        material = three.MeshPhongMaterial(
            color=_hex(colour),
            opacity=opacity,
            vertexColors=True,
            flatShading=True,
            depthWrite=opacity == 1,
            side=_FRONT if one_sided else _BOTH,
        )
        drawing = self._drawing(path, three.Mesh(geometry, material))
        drawing["object"]["geometries"][0]["data"]["attributes"]["color"]["normalized"] = True  # 255 means 1
        self._store(drawing)

    def segments(self, path: str, points: npt.NDArray[np.float64], colour: Colour, opacity: float = 1) -> None:
        """Draw thin lines at `path`. Each pair of the N x 3 `points` has the ends of one line."""
        three = self._meshcat.geometry
        material = three.LineBasicMaterial(color=_hex(colour), opacity=opacity, depthWrite=False)
        self._store(self._drawing(path, three.LineSegments(three.PointsGeometry(points.T), material)))

    def sprite(self, path: str, svg: str) -> None:
        """Draw a picture at `path`, one unit wide and high. It faces the viewer, and nothing covers it."""
        # meshcat's Python package has no sprites, but its viewer draws them: this is the format of three.js.
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
        self._store({"type": "set_object", "path": self._at(path).path.lower(), "object": sprite})

    def place(self, path: str, at: Point = (0, 0, 0), size: Point = (1, 1, 1)) -> None:
        """Move the object at `path` to `at`, and scale it to `size`."""
        matrix = np.diag([*size, 1.0])
        matrix[:3, 3] = at
        self._at(path).set_transform(matrix)

    def set(self, path: str, name: str, value: object) -> None:
        """Set a property of the object at `path`, by its name in three.js."""
        self._at(path).set_property(name, value)

    def animate(self, tracks: Sequence[Track], fps: int) -> None:
        """Play `tracks` once, all at the same time, and stop at their end."""
        animation = self._meshcat.animation.Animation(default_framerate=fps)
        for track in tracks:
            animated = self._at(track.path)
            for frame, value in track.keys:
                with animation.at_frame(animated, frame) as then:
                    then.set_property(track.name, track.type, list(value))
        self._root.set_animation(animation)

    def _at(self, path: str) -> Any:  # noqa: ANN401 - meshcat is untyped
        return self._root[path] if path else self._root

    def _drawing(self, path: str, drawn: Any) -> dict[str, Any]:  # noqa: ANN401 - meshcat is untyped
        # meshcat creates ids from the clock and the network card: our ids make the bytes of every run the same.
        for part, element in (("object", drawn), ("geometry", drawn.geometry), ("material", drawn.material)):
            element.uuid = f"{path} {part}"
        lowered: dict[str, Any] = self._meshcat.commands.SetObject(drawn, path=self._at(path).path).lower()
        return lowered

    def _store(self, message: dict[str, Any]) -> None:
        import umsgpack  # noqa: PLC0415 - a dependency of meshcat, needed only when a scene is drawn

        # There are many key frames, and single precision is sufficient for display.
        precision = "single" if message["type"] == "set_animation" else "double"
        self.commands.append(umsgpack.packb(message, force_float_precision=precision))


def _meshcat() -> Any:  # noqa: ANN401 - meshcat is untyped
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # raised in pyzmq, about itself
        import meshcat  # noqa: PLC0415 - see above: only when a scene is drawn
    return meshcat


def _hex(colour: Colour) -> int:
    red, green, blue = (round(255 * part) for part in colour)
    return red << 16 | green << 8 | blue
