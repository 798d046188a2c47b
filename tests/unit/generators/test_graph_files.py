"""Graphs of files that networkx reads; what is none has one message."""

from __future__ import annotations

import sys
from pathlib import Path
from random import Random

import pytest

from robochoc.formats import InvalidInputError
from robochoc.generators import graph_choice
from robochoc.generators.graph_choice import MAX_BYTES, read_graph
from robochoc.generators.random_csp import random_on
from tests.support.binary_problems import edges_of
from tests.support.cases import looped
from tests.support.program import robochoc_within

GRAPHML = """\
<graphml xmlns="http://graphml.graphdrawing.org/xmlns"><graph edgedefault="directed">
<node id="b"/><node id="a"/><node id="c"/><edge source="b" target="a"/><edge source="a" target="b"/>
<edge source="a" target="c"/></graph></graphml>
"""
FILES = {
    "town.graphml": GRAPHML,
    "town.gml": 'graph [ node [ id 5 label "b" ] node [ id 2 label "a" ] node [ id 9 label "c" ]'
    " edge [ source 5 target 2 ] edge [ source 2 target 9 ] ]",
    "town.gexf": '<gexf xmlns="http://www.gexf.net/1.2draft" version="1.2"><graph defaultedgetype="undirected"><nodes>'
    '<node id="b"/><node id="a"/><node id="c"/></nodes><edges><edge id="0" source="b" target="a"/>'
    '<edge id="1" source="a" target="c"/></edges></graph></gexf>',
    "town.edgelist": "# streets\nb a {'weight': 3}\na c\n",
    "town.edges": "10 2\n2 -1 7.5\n",
    "town.adjlist": "b a\na c\n",
    "town.net": "*Vertices 3\n1 b\n2 a\n3 c\n*Edges\n1 2\n2 3\n",
}


@looped("name", FILES)
def test_each_kind_of_file(name: str, tmp_path: Path) -> None:
    """Node a, or 2, is between the two others; they are numbered as in the file, or by their own numbers."""
    pytest.importorskip("networkx")
    (tmp_path / name).write_text(FILES[name])
    graph = read_graph(tmp_path / name)
    assert (graph.agents, graph.label) == (3, "town")
    assert graph.draw(Random(0)) == [(1, 2), (2, 3)]
    team = random_on(graph, 2, 0.25, 5)
    assert team.name == "random-3-2-town-0.25-5"
    assert edges_of(team) == {(1, 2), (2, 3)}


def test_a_label_is_a_name_that_a_folder_can_have(tmp_path: Path) -> None:
    pytest.importorskip("networkx")
    path = tmp_path / "our town: 1.edgelist"
    path.write_text("1 2\n")
    assert read_graph(path).label == "our-town-1"


@looped(
    ("name", "content", "said"),
    [
        ("town.dot", "graph {}", "'.dot' is not a type of graph files"),
        ("town.graphml", "<graphml>", "networkx cannot read it"),
        ("town.gml", "graph [", "networkx cannot read it"),
        ("town.gml", "\0\0", "networkx cannot read it"),
        ("town.edgelist", "a\n", "the graph has 0 nodes"),
        ("town.edgelist", "a a\n", "the node a is linked to itself"),
        ("town.graphml", "<!DOCTYPE a [<!ENTITY b 'c'>]>" + GRAPHML, "defines entities"),
    ],
)
def test_what_is_no_graph_has_one_message(name: str, content: str, said: str, tmp_path: Path) -> None:
    pytest.importorskip("networkx")
    (tmp_path / name).write_text(content)
    with pytest.raises(InvalidInputError) as refused:
        read_graph(tmp_path / name)
    assert said in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1


def test_a_graph_of_too_many_bytes_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("networkx")
    (tmp_path / "town.edges").write_text(" " * (MAX_BYTES + 1))
    with pytest.raises(InvalidInputError, match="is too large"):
        read_graph(tmp_path / "town.edges")


def test_a_graph_of_too_many_nodes_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("networkx")
    monkeypatch.setattr(graph_choice, "MAX_NODES", 3)
    (tmp_path / "town.edgelist").write_text("1 2\n2 3\n")
    assert read_graph(tmp_path / "town.edgelist").agents == 3
    (tmp_path / "town.edgelist").write_text("1 2\n2 3\n3 4\n")
    with pytest.raises(InvalidInputError, match="the graph has 4 nodes"):
        read_graph(tmp_path / "town.edgelist")


def test_without_networkx_one_line_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "town.edgelist").write_text("1 2\n")
    monkeypatch.setitem(sys.modules, "networkx", None)
    with pytest.raises(InvalidInputError, match=r"pip install 'robochoc\[graphs\]'"):
        read_graph(tmp_path / "town.edgelist")
    with pytest.raises(InvalidInputError, match="No such file"):
        read_graph(tmp_path / "nowhere.edgelist")


@pytest.mark.usefixtures("in_a_folder")
def test_the_command_takes_a_file(tmp_path: Path) -> None:
    pytest.importorskip("networkx")
    (tmp_path / "town.edgelist").write_text("1 2\n2 3\n")
    words = ["generate", "coloring", "--graph", "town.edgelist", "-o", "out"]
    assert robochoc_within(*words).stdout == "out: 3 robots, 2 constraints; next: robochoc solve out\n"
    for more, said in ((["--agents", 3], "--agents follows"), (["--degree", 3], "--degree is for --graph random")):
        done = robochoc_within(*words, *more)
        assert done.returncode == 2
        assert said in done.stderr
    (tmp_path / "town.edgelist").write_text("1 1\n")
    done = robochoc_within(*words, "--force")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
