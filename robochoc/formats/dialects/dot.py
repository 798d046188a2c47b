"""Graphviz: a team's constraint graph, laid out over a pseudo-tree (https://graphviz.org/doc/info/lang.html)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from robochoc.formats.dialects.constraint_graph import pseudo_tree, shared_constraints
from robochoc.formats.dialects.dialect import Dialect, ExportOptions, ExportResult, ImportOptions, ImportResult
from robochoc.model.problem import Team
from robochoc.solver.errors import UnsupportedError

NAME = "dot"


def _write(team: Team, options: ExportOptions) -> ExportResult:
    del options
    tree = pseudo_tree(team)
    shared: Counter[frozenset[str]] = Counter()
    for (one, other), number in shared_constraints(team).items():
        robots = frozenset((team.owner[one], team.owner[other]))
        if len(robots) > 1:
            shared[robots] += number
    lines = [f"graph {_quoted(team.name)} {{", "  node [shape=box];"]
    for robot in team.robots:
        names = "\\n".join(f"{one.name} ({len(one.domain)} values)" for one in robot.variables)
        lines.append(f'  {_quoted(robot.name)} [label={_quoted(f"{robot.name}")[:-1]}\\n{names}"];')
    for robot in team.robots:
        parent = tree[robot.name]
        if parent is not None:
            label = _label(shared[frozenset((parent, robot.name))])
            lines.append(f"  {_quoted(parent)} -- {_quoted(robot.name)} [style=bold{label}];")
    place = {name: number for number, name in enumerate(team.order)}
    for pair, number in shared.items():
        one, other = sorted(pair, key=place.__getitem__)
        if tree[one] != other and tree[other] != one:
            edge = f"{_quoted(one)} -- {_quoted(other)}"
            lines.append(f"  {edge} [style=dashed, constraint=false{_label(number)}];")
    return ExportResult({f"{team.name}.dot": "\n".join([*lines, "}", ""]).encode()})


def _label(number: int) -> str:
    return f', label="{number}"' if number > 1 else ""


def _quoted(name: str) -> str:
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _read(paths: Sequence[Path], options: ImportOptions) -> ImportResult:
    del options
    raise UnsupportedError(f"{paths[0]}: Graphviz files can be exported but not imported")


def _recognises(path: Path, beginning: bytes) -> bool:
    del path, beginning
    return False


DIALECT = Dialect(NAME, "Graphviz", _recognises, _read, _write)
