"""Names that describe the messages of a run in words: the order of the robots, their variables, and symbols."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from robochoc.model.problem import Team
from robochoc.protocols.order import PseudoTree
from robochoc.protocols.wording import Wording


class RunNames(NamedTuple):
    """The names for the messages in a run; empty if the team is unknown.

    Attributes:
        order: All robots, the highest priority first.
        interfaces: The variables whose values a robot sends, by robot.
        symbols: The names for the values of a symbolic variable, by variable.
        tree: The pseudo-tree induced by the order, if the protocol uses a pseudo-tree.
    """

    order: tuple[str, ...] = ()
    interfaces: Mapping[str, Sequence[str]] = {}
    symbols: Mapping[str, Sequence[str]] = {}
    tree: PseudoTree | None = None

    def wording(self, sender: str, receiver: str, *, on_tree: bool) -> Wording:
        """Return the names for describing a message. `on_tree`: whether the protocol uses the order's pseudo-tree."""
        branch = self.order
        if on_tree:
            known = self.tree if self.tree and sender in self.tree.parents else None
            branch = (*reversed(known.ancestors(sender)), sender) if known else ()
        return Wording(sender, receiver, self.order, self.interfaces, branch, self.symbols)


def run_names(team: Team, *, on_tree: bool) -> RunNames:
    """Return the names of the robots and variables in `team`."""
    tree = None
    if on_tree:
        parents = {robot.name: [parent.name for parent in robot.parents] for robot in team.robots}
        tree = PseudoTree.induced(team.order, parents)
    interfaces = {robot.name: robot.interface for robot in team.robots}
    symbols = {name: one.domain.symbols for name, one in team.variables.items() if one.domain.symbols}
    return RunNames(tuple(team.order), interfaces, symbols, tree)
