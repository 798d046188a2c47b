"""Distributed Constraint Reasoning Protocols unit: each protocol is one file that names its paper.

`protocol.py` declares the interface. Protocols are grouped in families, one folder each; `shared` contains parts that
several families use. A protocol's file contains its messages and settings as well, except where mypyc compiles the
protocol: then its messages are in `X_messages.py`.

Everything here is pure: no clock, no random numbers, no processes, no input or output (enforced by import-linter).

The names below are public, for authors of protocols. They are imported on first use.
"""

from __future__ import annotations

from robochoc.system.lazy_names import lazy_names

TYPE_CHECKING = False  # faster start-up
if TYPE_CHECKING:
    from robochoc.protocols.acts import Act, Performative
    from robochoc.protocols.chance import Chance
    from robochoc.protocols.dynamic import DynamicProtocol
    from robochoc.protocols.findings import Findings
    from robochoc.protocols.message import Message, Value
    from robochoc.protocols.order import PriorityOrder
    from robochoc.protocols.protocol import Protocol
    from robochoc.protocols.settings import Settings
    from robochoc.protocols.shared.cycles import CycleProtocol, CycleSettings
    from robochoc.protocols.shared.dfs import TreeProtocol
    from robochoc.protocols.traits import Traits
    from robochoc.protocols.wording import Wording
    from robochoc.solver.local_problem import LocalProblem

__all__ = [
    "Act",
    "Chance",
    "CycleProtocol",
    "CycleSettings",
    "DynamicProtocol",
    "Findings",
    "LocalProblem",
    "Message",
    "Performative",
    "PriorityOrder",
    "Protocol",
    "Settings",
    "Traits",
    "TreeProtocol",
    "Value",
    "Wording",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "Act": "robochoc.protocols.acts",
        "Chance": "robochoc.protocols.chance",
        "CycleProtocol": "robochoc.protocols.shared.cycles",
        "CycleSettings": "robochoc.protocols.shared.cycles",
        "DynamicProtocol": "robochoc.protocols.dynamic",
        "Findings": "robochoc.protocols.findings",
        "LocalProblem": "robochoc.solver.local_problem",
        "Message": "robochoc.protocols.message",
        "Performative": "robochoc.protocols.acts",
        "PriorityOrder": "robochoc.protocols.order",
        "Protocol": "robochoc.protocols.protocol",
        "Settings": "robochoc.protocols.settings",
        "Traits": "robochoc.protocols.traits",
        "TreeProtocol": "robochoc.protocols.shared.dfs",
        "Value": "robochoc.protocols.message",
        "Wording": "robochoc.protocols.wording",
    },
)
