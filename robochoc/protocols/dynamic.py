"""The base class of protocols that continue when the problem changes.

It is separate from `protocol.py`, which is compiled: such a protocol has two base classes, and mypyc allows only one.
"""

from __future__ import annotations

from abc import abstractmethod

from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.solver.explanation import Invalidated
from robochoc.solver.local_problem import LocalProblem


class DynamicProtocol(Protocol):
    """A protocol that continues when the problem changes and reuses the results that are still valid.

    Between two epochs the host calls `change` and, when all robots have changed, `resume`. Other protocols start again
    on the changed problem.
    """

    @abstractmethod
    def change(self, problem: LocalProblem, order: PriorityOrder, invalidated: Invalidated) -> None:
        """Adopt the changed problem, and drop everything that depends on `invalidated` knowledge. Send no messages.

        No robot searches in the meantime. A verdict that is still valid after the changes is kept, and ends the epoch
        at once.
        """

    @abstractmethod
    def resume(self, *, lossless: bool) -> None:
        """Continue the search; called before any message is received.

        Args:
            lossless: True if no message of the previous epoch was lost.
        """
