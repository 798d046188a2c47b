"""`robochoc solve --explain`: the pseudo-tree that the robots have built, for people."""

from __future__ import annotations

import io
from collections.abc import Mapping

from rich.console import Console
from rich.markup import escape
from rich.tree import Tree

from robochoc.formats import on_one_line
from robochoc.model.outcome import Outcome, PseudoTreeNode
from robochoc.model.priorities import natural_key

UNBROKEN = 1000


def explained(outcome: Outcome) -> str:
    """The tree, a robot a line, with its depth and its induced width; or that there is none."""
    places = outcome.tree
    if not places:
        return f"  {outcome.protocol} builds no pseudo-tree"
    below = _children(places)
    roots = below.get(None, [])
    known = f"depth {_depth(places, below)}, induced width {_width(places, below)}"
    count = f", {len(roots)} roots" if len(roots) > 1 else ""
    head = f"  pseudo-tree, built by the robots: {known}{count} ([neighbours further up])"
    return "\n".join([head, *(line for root in roots for line in _drawn(root, places, below))])


def _children(places: Mapping[str, PseudoTreeNode]) -> dict[str | None, list[str]]:
    """Who stands right below each robot, in natural order."""
    below: dict[str | None, list[str]] = {}
    for name in sorted(places, key=natural_key):
        below.setdefault(places[name].parent, []).append(name)
    return below


def _from_the_roots(below: Mapping[str | None, list[str]]) -> list[str]:
    """All robots, each after its parent."""
    found = list(below.get(None, []))
    for name in found:
        found.extend(below.get(name, []))
    return found


def _depth(places: Mapping[str, PseudoTreeNode], below: Mapping[str | None, list[str]]) -> int:
    """Edges on the longest way from a root to a leaf."""
    depths: dict[str | None, int] = {None: -1}
    for name in _from_the_roots(below):
        depths[name] = depths[places[name].parent] + 1
    return max(depths.values())


def _width(places: Mapping[str, PseudoTreeNode], below: Mapping[str | None, list[str]]) -> int:
    """The largest separator: robots above that a robot, and all below it, have to agree with (Dechter 2003, 4.1)."""
    separators: dict[str, set[str]] = {}
    for name in reversed(_from_the_roots(below)):
        above = {name for name in (places[name].parent, *places[name].pseudo_parents) if name is not None}
        separators[name] = above.union(*(separators[child] for child in below.get(name, []))) - {name}
    return max(map(len, separators.values()))


def _drawn(root: str, places: Mapping[str, PseudoTreeNode], below: Mapping[str | None, list[str]]) -> list[str]:
    trees = {root: Tree(_labelled(root, places))}
    waiting = [root]
    for name in waiting:
        for child in below.get(name, []):
            trees[child] = trees[name].add(_labelled(child, places))
            waiting.append(child)
    page = io.StringIO()
    Console(file=page, width=UNBROKEN, highlight=False).print(trees[root])
    return [f"    {line.rstrip()}" for line in page.getvalue().splitlines()]


def _labelled(name: str, places: Mapping[str, PseudoTreeNode]) -> str:
    above = ", ".join(places[name].pseudo_parents)
    return escape(on_one_line(f"{name} [{above}]" if above else name))
