"""The pseudo-tree built by the robots, as text (`robochoc solve --explain`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from robochoc.formats import on_one_line
from robochoc.model.outcome import Outcome, PseudoTreeNode, Verdict
from robochoc.model.priorities import natural_key
from robochoc.protocols.shared.dfs import TreeProtocol
from robochoc.run.defaults import CENTRAL
from robochoc.run.registry import protocol_named


def tree_text(outcome: Outcome) -> str:
    """Return the tree, one robot per line, with its depth and induced width, or a note that there is no tree.

    If a run ends while robots are still building the tree, some robots have a parent but there is no root, since roots
    are the last to complete.
    """
    nodes = outcome.tree
    if not nodes and (outcome.verdict != Verdict.UNKNOWN or not _builds_tree(outcome.protocol)):
        if outcome.protocol == CENTRAL:
            return "  the central solver builds no pseudo-tree"
        look = "to see its messages and decisions, add --sniff, or --journal FILE for 'robochoc replay FILE'"
        return f"  {outcome.protocol} builds no pseudo-tree; {look}"
    if not nodes or any(node.parent not in nodes for node in nodes.values() if node.parent is not None):
        return "  the run ended before the robots had built a pseudo-tree"
    below = _children(nodes)
    roots = below.get(None, [])
    known = f"depth {_depth(nodes, below)}, induced width {_width(nodes, below)}"
    count = f", {len(roots)} roots" if len(roots) > 1 else ""
    head = f"  pseudo-tree, built by the robots: {known}{count} ([neighbours further up])"
    return "\n".join([head, *(line for root in roots for line in _drawn(root, nodes, below))])


def _builds_tree(protocol: str) -> bool:
    return protocol != CENTRAL and issubclass(protocol_named(protocol), TreeProtocol)


def _children(nodes: Mapping[str, PseudoTreeNode]) -> dict[str | None, list[str]]:
    """Return the children of each robot, in natural order."""
    below: dict[str | None, list[str]] = {}
    for name in sorted(nodes, key=natural_key):
        below.setdefault(nodes[name].parent, []).append(name)
    return below


def _from_the_roots(below: Mapping[str | None, list[str]]) -> list[str]:
    """Return all robots, each after its parent."""
    found = list(below.get(None, []))
    for name in found:
        found.extend(below.get(name, []))
    return found


def _depth(nodes: Mapping[str, PseudoTreeNode], below: Mapping[str | None, list[str]]) -> int:
    """Return the number of edges between a root and the deepest leaf."""
    depths: dict[str | None, int] = {None: -1}
    for name in _from_the_roots(below):
        depths[name] = depths[nodes[name].parent] + 1
    return max(depths.values())


def _width(nodes: Mapping[str, PseudoTreeNode], below: Mapping[str | None, list[str]]) -> int:
    """Return the size of the largest separator (Dechter 2003, 4.1): ancestors that share constraints with a subtree."""
    separators: dict[str, set[str]] = {}
    for name in reversed(_from_the_roots(below)):
        above = {name for name in (nodes[name].parent, *nodes[name].pseudo_parents) if name is not None}
        separators[name] = above.union(*(separators[child] for child in below.get(name, []))) - {name}
    return max(map(len, separators.values()))


def _drawn(root: str, nodes: Mapping[str, PseudoTreeNode], below: Mapping[str | None, list[str]]) -> Iterator[str]:
    """Yield a line per robot, parents first. There is no recursion, since trees may be as deep as teams are large."""
    waiting = [(root, "", "")]
    while waiting:
        name, branch, indent = waiting.pop()
        yield f"    {branch}{_labelled(name, nodes)}"
        children = below.get(name, [])
        for child in reversed(children):
            last = child is children[-1]
            corner, line = ("└── ", "    ") if last else ("├── ", "│   ")
            waiting.append((child, indent + corner, indent + line))


def _labelled(name: str, nodes: Mapping[str, PseudoTreeNode]) -> str:
    above = ", ".join(nodes[name].pseudo_parents)
    return on_one_line(f"{name} [{above}]" if above else name)
