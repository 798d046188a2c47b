"""The inventory of readers: an unknown part at any place of any input is refused, whatever reads it.

Each reader of files that people write has a line here, with an input that has all kinds of its parts. A reader that is
added belongs into the table; what makes readers strict is named in docs/explanation/design/files.md.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from copy import deepcopy
from functools import partial, reduce
from operator import getitem
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import pytest
import yaml
from lxml import etree

from robochoc.app.sketch.sketch import Sketch
from robochoc.cli.options.problems import READ
from robochoc.communication.simulator.channel import read_channel
from robochoc.experiments.study import read_study
from robochoc.formats import InvalidInputError, read_robot, read_team
from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import read_foreign
from robochoc.formats.names_file import original_names
from robochoc.formats.order_file import read_order
from robochoc.maps.ground_map import read_ground_map
from robochoc.maps.occupancy.grid import read_occupancy_grid
from robochoc.maps.octomap.octree import read_octree
from robochoc.vehicles.fleet import FleetError, read_fleet
from tests.support.cases import looped
from tests.support.foreign_files import CFN, FRODO, WCSP, XDISCSPS

REFUSED = (InvalidInputError, MistakeError, FleetError, ValueError)

PYDCOP = """
name: small
objective: min
domains: {few: {values: [0, 1]}}
variables: {x: {domain: few, cost_function: 2 * x}, y: {domain: few}}
external_variables: {e: {domain: few, initial_value: 1}}
constraints:
  k: {type: intention, function: x + y + e}
  t: {type: extensional, variables: [x, y], default: 1, values: {2: 0 0}}
agents: [a1, a2]
distribution_hints: {must_host: {a1: [x]}}
"""
TASKS = """
name: shared
model: several
distance: streets
places: 1
tours: yes
robots:
  ann: {at: [0, 0], skills: [eye], capacity: 3, most: 2, speed: 2}
  bob: {at: [1, 2]}
tasks:
  dig: {at: [3, 3], needs: eye, worth: 9, load: 1, deadline: 9, robots: 1}
  fix: {worth: 3}
synergies:
  - {tasks: [dig, fix], worth: 2}
"""
GRID = {
    "image": "plan.pgm", "resolution": 0.5, "origin": [0, 0, 0], "negate": 0, "occupied_thresh": 0.65,
    "free_thresh": 0.25, "mode": "trinary",
}  # fmt: skip
FLEET = {
    "vehicles": {"A": "udpin://0.0.0.0:14540", "B": {"link": "udpin://0.0.0.0:14541", "at": [1, 0, 0]}},
    "fence": [[0, 0, 0], [6, 6, 6]], "takeoff": 2, "near": 0.5, "end": "land", "patience": 9, "time": 60,
    "distance": 1, "downwash": 1,
}  # fmt: skip
MAP = {
    "columns": 3, "rows": 3, "starts": {"A": [1, 1]}, "blocked": [{"x": 2, "y": 2}], "scale": 1.0,
    "volume": {"levels": 2, "starts": {"A": 1}},
}  # fmt: skip
CHANNEL = {
    "latency_ms": 3.0, "bursts": {"begin": 0.1, "end": 0.5, "loss": 0.9},
    "path_loss": {"power_dbm": 20.0, "sensitivity_dbm": -80.0}, "positions": {"A": [0.0, 1.0]},
    "links": [{"between": ["A", "B"], "loss": 0.5}],
}  # fmt: skip
STUDY = {
    "title": "Small", "repeat": 1, "record": ["robots"],
    "problems": [{"family": "random", "agents": 4, "domain": 2, "density": 0.5, "tightness": 0.2, "seed": 1,
                  "scenario": {"events": 2, "rate": 0.1}}],
    "runs": [{"protocol": "abt", "settings": {}}],
    "limits": {"timeout": 5.0},
    "report": {"over": "agents", "names": {"abt": "ABT"}},
}  # fmt: skip
ROBOT = """<instance><presentation type="DisWCSP" scale="0.1"/>
<domains nbDomains="1"><domain name="D" nbValues="2">1..2</domain></domains>
<variables nbVariables="1"><variable name="{me}.x" domain="D"/></variables>
<topics><topic name="/{me}" x="{me}.x" y="1"/></topics>
<agents_neighbours><agents_parent>{parent}</agents_parent><agents_children>{child}</agents_children></agents_neighbours>
<relations><relation name="R" arity="2" semantics="soft" defaultCost="2">1:1 1</relation>
<relation name="S" arity="1" semantics="soft" defaultCost="2">1:1</relation></relations>
<predicates><predicate name="P"><parameters>int X int Y</parameters>
<expression><functional>ne(X,Y)</functional></expression></predicate></predicates>
<functions><function name="F"><parameters>int X</parameters><expression><functional>add(X,1)</functional></expression>
</function></functions>
<constraints><constraint name="s" arity="1" scope="{me}.x" reference="S"><parameters>{me}.x</parameters></constraint>
<constraint name="f" scope="{me}.x" reference="F"><parameters>{me}.x</parameters></constraint>
</constraints></instance>"""
SHARED = """<agent name="A"><constraints><constraint name="r" model="TKC" scope="A.x B.x" reference="R"/>
<constraint name="p" scope="A.x B.x" reference="P" cost="3"><parameters>A.x B.x</parameters></constraint></constraints>
</agent>"""
FIRST = ROBOT.format(me="A", parent="", child='<agent name="B" variable="A.x"/>')
SECOND = ROBOT.format(me="B", parent=SHARED, child="")
SCENARIO = """<scenario><event after="5 messages"><add_constraint agent="B" parent="A">
<constraint name="n" model="TKC" scope="A.x B.x" reference="ne"><parameters>A.x B.x</parameters></constraint>
</add_constraint></event><event after="solved"><remove_constraint agent="B" parent="A" name="n"/></event>
<event after="solved"><remove_agent name="B"/></event></scenario>"""
OCTOMAP = b"# Octomap OcTree binary file\nid OcTree\nsize 2\nres 0.5\ndata\n\x01\x00"


class Reader(NamedTuple):
    """A reader, an input that it reads, and the name of the file.

    Attributes:
        name: The name of the file.
        content: Its content: as data for mappings.
        read: Reads the file at a path.
        open: The places of mappings whose values the reader leaves out by its documentation.
    """

    name: str
    content: Any
    read: Callable[[Path], object]
    open: tuple[str, ...] = ()


def foreign(path: Path) -> object:
    return read_foreign([path], ImportOptions())


def pydcop_with(beside: str, text: str, path: Path) -> object:
    problem = path.with_name(beside)
    problem.write_text(text)
    return read_foreign([problem, path], ImportOptions())


def grid(path: Path) -> object:
    path.with_name("plan.pgm").write_bytes(b"P5 1 1 255\n\0")
    return read_occupancy_grid(path)


def team(path: Path) -> object:
    for name, text in (("A.xml", FIRST), ("B.xml", SECOND)):
        if path.name != name:
            path.with_name(name).write_text(text)
    return read_team(path.parent)


def names(path: Path) -> object:
    return original_names(path.parent)


MAPPINGS = [
    Reader("problem.yaml", yaml.safe_load(PYDCOP), foreign),
    Reader("d.yaml", {"distribution": {"a1": ["x"], "a2": ["y"]}}, partial(pydcop_with, "p.yaml", PYDCOP)),
    Reader(
        "s.yaml",
        {"events": [{"id": "w", "delay": 3}, {"id": "e", "actions": [{"type": "remove_agent", "agent": "a2"}]}]},
        partial(pydcop_with, "p.yaml", PYDCOP),
    ),
    Reader("tasks.yaml", yaml.safe_load(TASKS), foreign),
    Reader("plan.yaml", GRID, grid),
    Reader("fleet.yaml", FLEET, read_fleet),
    Reader("map.json", MAP, lambda path: read_ground_map(path.read_bytes()), ("starts", "volume.starts")),
    Reader("radio.toml", CHANNEL, read_channel, ("positions",)),
    Reader("study.toml", STUDY, read_study, ("report.names",)),
    Reader("names.json", {"dialect": "frodo", "names": {"a": "A#"}}, names, ("names",)),
]
ELEMENTS = [
    Reader("A.xml", FIRST, read_robot),
    Reader("B.xml", SECOND, team),
    Reader("scenario.xml", SCENARIO, team),
    Reader("frodo.xml", FRODO, foreign),
    *(Reader(f"xdiscsp-{number}.xml", text, foreign) for number, text in enumerate(XDISCSPS)),
]
TEXTS = [
    Reader("a.wcsp", WCSP.encode(), foreign),
    Reader("a.cfn", CFN.encode(), foreign),
    Reader("a.bt", OCTOMAP, lambda path: read_octree(path.read_bytes())),
    Reader("order.txt", b"B\nA\n", lambda path: read_order(path, read_pair(path))),
]


def read_pair(path: Path) -> Any:  # noqa: ANN401 - a team
    (path.parent / "pair").mkdir(exist_ok=True)
    return team(path.parent / "pair" / "none")


def written(name: str, content: Any) -> str:  # noqa: ANN401 - data of any kind
    if name.endswith(".toml"):
        return "\n".join(f"{key} = {_inline(value)}" for key, value in content.items())
    return json.dumps(content) if name.endswith(".json") else yaml.safe_dump(content, sort_keys=False)


def _inline(value: object) -> str:
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_inline(one)}' for key, one in value.items())} }}"
    return f"[{', '.join(map(_inline, value))}]" if isinstance(value, list) else json.dumps(value)


def mappings_in(content: object, *way: Any) -> Iterator[tuple[Any, ...]]:  # noqa: ANN401 - keys and numbers
    """Yield the way to each mapping in `content`: keys and numbers."""
    if isinstance(content, dict):
        yield way
    parts = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, one in parts:
        yield from mappings_in(one, *way, key)


@looped("reader", MAPPINGS)
def test_an_unknown_key_in_any_mapping_is_refused(reader: Reader, tmp_path: Path) -> None:
    path = tmp_path / reader.name
    path.write_text(written(reader.name, reader.content))
    reader.read(path)
    for way in mappings_in(reader.content):
        place = ".".join(map(str, way))
        if place in reader.open:
            continue
        copy = deepcopy(reader.content)
        reduce(getitem, way, copy)["zebra"] = 1
        path.write_text(written(reader.name, copy))
        with pytest.raises(REFUSED) as refused:
            reader.read(path)
        assert "\n" not in str(refused.value) or "zebra" in str(refused.value), place


@pytest.mark.parametrize("reader", ELEMENTS, ids=lambda reader: reader.name)
def test_an_unknown_part_of_any_element_is_refused(reader: Reader, tmp_path: Path) -> None:
    path = tmp_path / reader.name
    path.write_text(reader.content)
    reader.read(path)
    count = sum(1 for _ in etree.fromstring(reader.content).iter())
    for number in range(count):
        for kind in ("attribute", "element", "text"):
            tree = etree.fromstring(reader.content)
            element = [*tree.iter()][number]
            if kind == "attribute":
                element.set("zebra", "1")
            elif kind == "element":
                element.append(etree.Element("zebra"))
            elif len(element) and element.tag != "parameters":
                element.text = "zebra"
            else:
                continue
            path.write_bytes(etree.tostring(tree))
            with pytest.raises(REFUSED) as refused:
                reader.read(path)
            assert "zebra" in str(refused.value) or "text" in str(refused.value), (element.tag, kind)


@pytest.mark.parametrize("reader", TEXTS, ids=lambda reader: reader.name)
def test_anything_after_the_end_is_refused(reader: Reader, tmp_path: Path) -> None:
    path = tmp_path / reader.name
    path.write_bytes(reader.content)
    reader.read(path)
    path.write_bytes(reader.content + b" zebra 1\n")
    with pytest.raises(REFUSED, match=r"zebra|after its last node"):
        reader.read(path)


def test_each_format_that_is_read_is_in_the_inventory() -> None:
    assert set(READ) == {"frodo", "xdiscsp", "tasks", "pydcop", "cfn", "wcsp", "xcsp3"}  # XCSP3: test_xcsp3.py


def test_the_application_s_sketches_have_no_unknown_fields() -> None:
    found: set[type] = set()

    def look(kind: msgspec.inspect.Type) -> None:
        if isinstance(kind, msgspec.inspect.StructType) and kind.cls not in found:
            found.add(kind.cls)
            assert kind.forbid_unknown_fields, kind.cls
            for field in kind.fields:
                look(field.type)
        for name in ("item_type", "key_type", "value_type"):
            if hasattr(kind, name):
                look(getattr(kind, name))
        for one in getattr(kind, "item_types", getattr(kind, "types", ())):
            look(one)

    look(msgspec.inspect.type_info(Sketch))
    assert len(found) > 3
