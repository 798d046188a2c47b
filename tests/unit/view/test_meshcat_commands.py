"""Commands of meshcat's viewer, compared byte for byte with those of meshcat's Python package."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
import umsgpack

from robochoc.view.meshcat_commands import MeshcatCommands, Track
from robochoc.view.meshes import TriangleMesh, quadrotor

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # raised in pyzmq, about itself
    import meshcat
    from meshcat.animation import Animation
    from meshcat.commands import SetObject

Random = np.random.Generator
Part = tuple[str, tuple[Any, ...], dict[str, Any]]
"""A method of `MeshcatCommands`, and its arguments."""

PATHS = "", "walls", "drones/1 Robot1.1/body", "drones/2 Ärger/body/<object>", "/Cameras/default/rotated/<object>"


class ReferenceCommands:
    """The messages that meshcat's Python package sends to its server, packed as it packs them."""

    def __init__(self) -> None:
        self.commands: list[bytes] = []
        self.root = meshcat.Visualizer(window=self)

    def send(self, command: Any) -> None:  # noqa: ANN401 - meshcat is untyped
        self.store(command.lower())

    def store(self, message: dict[str, Any]) -> None:
        precision = "single" if message["type"] == "set_animation" else "double"
        self.commands.append(umsgpack.packb(message, force_float_precision=precision))

    def at(self, path: str) -> Any:  # noqa: ANN401 - meshcat is untyped
        return self.root[path] if path else self.root

    def draw(self, path: str, drawn: Any, **attributes: object) -> None:  # noqa: ANN401 - meshcat is untyped
        for part, element in (("object", drawn), ("geometry", drawn.geometry), ("material", drawn.material)):
            element.uuid = f"{path} {part}"
        lowered = SetObject(drawn, path=self.at(path).path).lower()
        lowered["object"]["geometries"][0]["data"]["attributes"].get("color", {}).update(attributes)
        self.store(lowered)

    def mesh(
        self, path: str, shape: TriangleMesh, colour: tuple[float, ...], opacity: float = 1, *, one_sided: bool = False
    ) -> None:
        geometry = meshcat.geometry.TriangularMeshGeometry(shape.vertices, shape.faces)
        geometry.color = np.rint(255 * shape.colours).astype(np.uint8)
        if len(shape.vertices) < 256:
            geometry.faces = shape.faces.astype(np.uint8)
        material = meshcat.geometry.MeshPhongMaterial(
            color=_hex(colour),
            opacity=opacity,
            vertexColors=True,
            flatShading=True,
            depthWrite=opacity == 1,
            side=0 if one_sided else 2,
        )
        self.draw(path, meshcat.geometry.Mesh(geometry, material), normalized=True)

    def segments(self, path: str, points: Any, colour: tuple[float, ...], opacity: float = 1) -> None:  # noqa: ANN401
        material = meshcat.geometry.LineBasicMaterial(color=_hex(colour), opacity=opacity, depthWrite=False)
        self.draw(path, meshcat.geometry.LineSegments(meshcat.geometry.PointsGeometry(points.T), material))

    def place(self, path: str, at: Sequence[float] = (0, 0, 0), size: Sequence[float] = (1, 1, 1)) -> None:
        matrix = np.diag([*size, 1.0])
        matrix[:3, 3] = at
        self.at(path).set_transform(matrix)

    def set(self, path: str, name: str, value: object) -> None:
        self.at(path).set_property(name, value)

    def animate(self, tracks: Sequence[Track], fps: int) -> None:
        animation = Animation(default_framerate=fps)
        for track in tracks:
            for frame, value in track.keys:
                with animation.at_frame(self.at(track.path), frame) as then:
                    then.set_property(track.name, track.type, list(value))
        self.root.set_animation(animation)


def _hex(colour: tuple[float, ...]) -> int:
    red, green, blue = (round(255 * part) for part in colour)
    return 65536 * red + 256 * green + blue


def _mesh(random: Random) -> Part:
    shape = quadrotor()
    if random.random() < 0.7:
        vertices, faces = random.choice([1, 3, 8, 255, 256, 300]), random.integers(1, 20)
        corners = random.integers(0, vertices, (faces, 3))
        shape = TriangleMesh(random.normal(0, 9, (vertices, 3)), corners, random.random((vertices, 3)))
    opacity = random.choice([1, 1.0, 0.3])
    return "mesh", (_path(random), shape, _colour(random), opacity.item()), {"one_sided": random.random() < 0.5}


def _segments(random: Random) -> Part:
    points = random.normal(0, 9, (2 * int(random.integers(0, 200)), 3))
    return "segments", (_path(random), points, _colour(random), float(random.random())), {}


def _place(random: Random) -> Part:
    return "place", (_path(random), tuple(random.normal(0, 1e3, 3).tolist()), (1, *random.random(2).tolist())), {}


def _set(random: Random) -> Part:
    values = [False, 28, -5, 1.5, [0.25, 1, -3.5e9], "text ✓", 70_000, -(2**40), None]
    return "set", (_path(random), "position" * int(random.integers(1, 40)), values[random.integers(len(values))]), {}


def _animate(random: Random) -> Part:
    tracks = []
    for number in range(int(random.integers(0, 20))):
        length = int(random.choice([1, 2, 15, 16, 40]))
        times: list[float] = np.sort(random.random(length) * 900).tolist()
        if random.random() < 0.5:
            times[0] = 0
        values = random.normal(0, 1, (length, int(random.choice([1, 3, 4])))).tolist()
        kind = ["vector3", "quaternion", "color"][random.integers(3)]
        tracks.append(Track(f"drones/{number // 2}", f"part{number}", kind, [*zip(times, values, strict=True)]))
    return "animate", (tracks, int(random.integers(1, 60))), {}


def _path(random: Random) -> str:
    return PATHS[random.integers(len(PATHS))]


def _colour(random: Random) -> tuple[float, ...]:
    return (1, 1, 1) if random.random() < 0.1 else tuple(random.random(3).tolist())


PARTS: tuple[Callable[[Random], Part], ...] = (_mesh, _segments, _place, _set, _animate)


def compare(seed: int) -> None:
    random = np.random.default_rng(seed)
    ours, reference = MeshcatCommands(), ReferenceCommands()
    for part in PARTS:
        name, arguments, options = part(random)
        getattr(ours, name)(*arguments, **options)
        getattr(reference, name)(*arguments, **options)
        assert ours.commands[-1] == reference.commands[-1], (name, arguments, options)


def test_commands_have_the_bytes_of_meshcats_package() -> None:
    for seed in range(60):
        compare(seed)


@pytest.mark.more
def test_thousands_of_commands_have_the_bytes_of_meshcats_package() -> None:
    for seed in range(60, 2_000):
        compare(seed)
