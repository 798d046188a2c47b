"""The base of protocols that continue when the problem changes.

It is apart from `protocol.py`, which is compiled: such a protocol has two bases, and mypyc allows one.
"""

from __future__ import annotations

from abc import abstractmethod

from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.solver.explanation import Invalidated
from robochoc.solver.local_problem import LocalProblem


class DynamicProtocol(Protocol):
    """A protocol that continues when the problem changes, with the results that are still valid.

    Between two epochs the host calls `change`, and once all robots have changed, `resume`. Other protocols start again
    on the changed problem.
    """

    @abstractmethod
    def change(self, problem: LocalProblem, order: PriorityOrder, invalidated: Invalidated) -> None:
        """Adopt the changed problem, and drop all that depends on anything `invalidated`. Send nothing.

        No robot searches meanwhile. A verdict that is still valid after the changes is kept, and ends the epoch at
        once.
        """

    @abstractmethod
    def resume(self, *, lossless: bool) -> None:
        """Continue the search; called before any message.

        Args:
            lossless: No message of the previous epoch was lost.
        """
