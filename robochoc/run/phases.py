"""The phases of a run: the search by the protocol asked for, and the one that decides which robots withdraw.

A protocol that minimises costs decides itself which robots withdraw (`Withdrawal.MINIMUM`): the run has one phase.
Otherwise another protocol takes over once the team is known to have no solution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits
from robochoc.run.defaults import DEFAULT_COST_PROTOCOL, FIRST_FIT
from robochoc.run.options import Options, Withdrawal
from robochoc.run.registry import protocol_or_stage
from robochoc.solver.agent_problem import RunParameters


@dataclass(frozen=True)
class RunPhase:
    """One phase of a run.

    `name` is the protocol's name, `parameters` what all robots are given beside the problem. With `withdrawal`, robots
    may withdraw. `takes_over`: this is not the protocol that was asked for.
    """

    name: str
    protocol: type[Protocol]
    parameters: RunParameters
    withdrawal: bool = False
    takes_over: bool = False

    @property
    def traits(self) -> Traits:
        """Return the traits of the protocol."""
        return self.protocol.traits


def first_phase(options: Options, protocol: type[Protocol], withdrawal_cost: Callable[[], float]) -> RunPhase:
    """Return the search by `protocol`, the one that was asked for.

    Args:
        options: how to run.
        protocol: the class of the protocol that `options` name.
        withdrawal_cost: returns what the withdrawal of a robot of weight 1 costs.
    """
    withdrawal = options.withdraw == Withdrawal.MINIMUM and protocol.traits.costs
    cost = withdrawal_cost() if withdrawal else None
    parameters = RunParameters(options.seed, options.settings, cost, options.dropped)
    return RunPhase(options.protocol, protocol, parameters, withdrawal)


def second_phase(options: Options, withdrawal_cost: Callable[[], float]) -> RunPhase:
    """Return the search that decides which robots withdraw, for a team without a solution.

    The protocol was not asked for, so it gets no settings. For the arguments see `first_phase`.
    """
    name = DEFAULT_COST_PROTOCOL if options.withdraw == Withdrawal.MINIMUM else FIRST_FIT
    protocol = protocol_or_stage(name)
    cost = withdrawal_cost() if protocol.traits.costs else None
    parameters = RunParameters(options.seed, withdrawal_cost=cost, message_loss=options.dropped)
    return RunPhase(name, protocol, parameters, withdrawal=True, takes_over=True)
