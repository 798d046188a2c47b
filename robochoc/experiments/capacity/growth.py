"""Problems that grow: copies of a team, larger task lists, or several given problems in the order of their size."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import msgspec

from robochoc.formats.dialects.pydcop.files import sections
from robochoc.formats.problems import read_problem
from robochoc.formats.yaml_tree import Node, read_yaml
from robochoc.maps.file_content import as_input_errors, read_content
from robochoc.model.copies import copied_team
from robochoc.model.problem import Team
from robochoc.solver.errors import UnsupportedError

LIST_BYTES_MAX = 1 << 20
"""The maximum size of a task list, in bytes."""
_NOT_NAMES = {"skills", "needs"}
"""The keys whose words are not names of robots or tasks."""


class Growth(NamedTuple):
    """A problem that can be grown.

    Attributes:
        text: A sentence that says what is grown.
        team_at: Returns the team of a size: 1 is the given problem, 2 is twice as large. Raises `InvalidInputError`.
        given: The number of given problems, which are not grown: their sizes are 1, 2, and so on. None: it is grown.
    """

    text: str
    team_at: Callable[[int], Team]
    given: int | None = None


def growth_of(paths: Sequence[Path]) -> Growth:
    """Return how the problem at the only path is grown; several problems are measured as they are, by their size.

    Raises:
        InvalidInputError: a problem is not valid.
        UnsupportedError: a problem has a scenario.
    """
    if len(paths) > 1:
        teams = sorted((_constant_team(path) for path in paths), key=lambda team: len(team.order))
        text = f"the {len(teams)} given problems, as they are, in the order of their numbers of robots"
        return Growth(text, lambda size: teams[size - 1], given=len(teams))
    path = paths[0]
    if path.is_file() and _is_task_list(path):
        return _grown_list(path)
    team = _constant_team(path)
    text = f"copies of {team.name}; copies share no constraints, so each copy is as difficult as the given team"
    return Growth(text, lambda size: copied_team(team, size))


def _constant_team(path: Path) -> Team:
    """Return the team at a path. Raises `UnsupportedError` if it has a scenario."""
    team = read_problem(path).team
    if team.dynamic:
        raise UnsupportedError(f"{team.name} has a scenario: capacity is measured for problems that do not change")
    return team


def _is_task_list(path: Path) -> bool:
    return {"robots", "tasks"} <= _sections_of(path)


def _sections_of(path: Path) -> set[str]:
    with as_input_errors(path):
        return sections(read_content(path, LIST_BYTES_MAX).decode("utf-8", "replace").lstrip("\ufeff"))


def check_is_complete(paths: Sequence[Path]) -> None:
    """Raise `UnsupportedError` if a problem needs a file that is not at its path: the map of a list."""
    for path in paths:
        if path.is_file() and _is_task_list(path) and "map" in _sections_of(path):
            raise UnsupportedError(f"{path.name} has a map, which is not sent to other machines: measure it on each")


def _grown_list(path: Path) -> Growth:
    given = read_problem(path)
    with as_input_errors(path):
        text = read_content(path, LIST_BYTES_MAX).decode()
        listed: dict[str, Any] = read_yaml(text, _plain, "a list has robots and tasks")
    on_map = "map" in listed
    where = "at the same places, as the list has a map" if on_map else "beside it, so that densities stay the same"

    def team_at(size: int) -> Team:
        if size == 1:
            return given.team
        with TemporaryDirectory(prefix="robochoc-capacity-") as folder:
            beside = path.parent if on_map else Path(folder)
            return _team_of(grown_list(listed, size, moved=not on_map), Path(folder) / f"{path.stem}.json", beside)

    text = f"copies of the robots and tasks of {given.team.name}, all in one list, each copy {where}"
    return Growth(text, team_at)


def _team_of(listed: Mapping[str, Any], file: Path, beside: Path) -> Team:
    """Return the team of a list, whose map is a file in the folder `beside`."""
    if "map" in listed:
        listed = {**listed, "map": str((beside / str(listed["map"])).absolute())}
    file.write_bytes(msgspec.json.encode(listed))
    return read_problem(file).team


def grown_list(listed: Mapping[str, Any], size: int, *, moved: bool = True) -> dict[str, Any]:
    """Return a task list with `size` copies of the robots, tasks and synergies of `listed`.

    Args:
        listed: The list, as plain values. It is not modified.
        size: The number of copies.
        moved: True to place the copies beside each other, on a square grid, at distances that keep the density.
    """
    points = [entry["at"] for part in ("robots", "tasks") for entry in listed[part].values() if _is_point(entry)]
    steps = _steps(points) if moved else (0, 0)
    names = {*listed["robots"], *listed["tasks"]}
    columns = math.isqrt(size - 1) + 1
    found: dict[str, Any] = {**listed, "robots": {}, "tasks": {}, "synergies": []}
    for copy in range(size):
        ending = f"_{copy + 1}" if copy else ""
        new = {name: f"{name}{ending}" for name in names}
        by = (steps[0] * (copy % columns), steps[1] * (copy // columns))
        for part in ("robots", "tasks"):
            for name, entry in listed[part].items():
                found[part][new[name]] = _moved(_renamed(entry, new), by)
        found["synergies"] += _renamed(listed.get("synergies") or [], new)
    if not found["synergies"]:
        del found["synergies"]
    return found


def _is_point(entry: Any) -> bool:  # noqa: ANN401 - a value from a file
    at = entry.get("at") if isinstance(entry, dict) else None
    return isinstance(at, list) and len(at) > 1 and all(isinstance(one, int | float) for one in at)


def _steps(points: Sequence[Sequence[float]]) -> tuple[float, float]:
    """Return the distances between copies along x and y: the extent of the points, and their mean spacing."""
    if not points:
        return 0, 0
    sides = [max(one[axis] for one in points) - min(one[axis] for one in points) for axis in (0, 1)]
    spacing = max(1, round(math.sqrt(max(sides[0], 1) * max(sides[1], 1) / len(points))))
    return math.ceil(sides[0]) + spacing, math.ceil(sides[1]) + spacing


def _moved(entry: Any, by: tuple[float, float]) -> Any:  # noqa: ANN401 - a value from a file
    if not _is_point(entry):
        return entry
    x, y, *rest = entry["at"]
    return {**entry, "at": [x + by[0], y + by[1], *rest]}


def _renamed(value: Any, names: Mapping[str, str]) -> Any:  # noqa: ANN401 - a value from a file
    """Return `value` with new names of robots and tasks."""
    match value:
        case dict():
            return {key: one if key in _NOT_NAMES else _renamed(one, names) for key, one in value.items()}
        case list():
            return [_renamed(one, names) for one in value]
        case str():
            return names.get(value, value)
        case _:
            return value


def _plain(node: Node) -> Any:  # noqa: ANN401 - a value from a file
    """Return a value in a YAML file as Python's own types."""
    if node.is_mapping:
        return {str(key): _plain(value) for key, value in node.named()}
    if node.items is not None:
        return [_plain(one) for one in node.items]
    value = node.scalar
    if isinstance(value, Fraction):
        return int(value) if value.denominator == 1 else float(value)
    return value
