"""The phases of a run: the search by the chosen protocol, a repair, and the search that decides which robots withdraw.

A protocol that minimises costs decides itself which robots withdraw (`Withdrawal.MINIMUM`), so the run has one phase.
With other protocols a second phase with another protocol follows when it is known that the team has no solution.

A repair follows an incomplete protocol that has ended, and all of whose assignments violate hard constraints. The
robots begin with the assignment that violates the fewest, and continue with `gdba`, which raises the weights of
violated constraints until they are satisfied. In a local minimum, each robot raises the entries of its present value
(`scope=C`), whatever the others' values are. If many robots have taken the same place, none satisfies the capacity by
its own move, so each robot must remember that the place is taken while the others change. Single entries (E) and whole
tables (T, the default of `gdba`) leave some capacities violated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits
from robochoc.run.defaults import DEFAULT_COST_PROTOCOL, FIRST_FIT, REPAIR
from robochoc.run.options import Options, Withdrawal
from robochoc.run.registry import protocol_or_stage
from robochoc.run.starts import Start
from robochoc.solver.agent_problem import RunParameters, StartValues
from robochoc.system.lazy_dataclass import dataclass


@dataclass(frozen=True)
class RunPhase:
    """A phase of a run.

    `name` is the protocol's name, `parameters` are common to all robots. If `withdrawal` is set, robots may withdraw.
    `takes_over` is true in the second phase, in which another protocol replaces the chosen one. `start_cost` is the
    cost of the start assignment, if it is a solution (`run/starts.py`).

    In a run with stages (`run/stages.py`), `reserved_s` are the seconds that are left for later stages. If `kept` is
    set, the search is restarted whenever it ends, and each robot keeps its value of the best assignment with this
    probability.
    """

    name: str
    protocol: type[Protocol]
    parameters: RunParameters
    withdrawal: bool = False
    takes_over: bool = False
    start_cost: float | None = None
    reserved_s: float = 0.0
    kept: float | None = None

    def beginning_with(self, start: Start) -> RunPhase:
        """Return this phase, which begins with `start`. Its cost is passed to robots that can use it."""
        bound = start.cost if self.traits.upper_bound else None
        parameters = self.parameters._replace(start=start.values, upper_bound=bound)
        return replace(self, parameters=parameters, start_cost=start.cost)

    @property
    def traits(self) -> Traits:
        """Return the traits of the protocol."""
        return self.protocol.traits


def first_phase(options: Options, protocol: type[Protocol], withdrawal_cost: Callable[[], float]) -> RunPhase:
    """Return the phase of the chosen protocol.

    Args:
        options: How to run.
        protocol: The class of the protocol that `options` name.
        withdrawal_cost: Returns the withdrawal cost of a robot of weight 1.
    """
    withdrawal = options.withdraw == Withdrawal.MINIMUM and protocol.traits.costs
    cost = withdrawal_cost() if withdrawal else None
    parameters = RunParameters(options.seed, options.settings, cost, options.dropped)
    return RunPhase(options.protocol, protocol, parameters, withdrawal)


def second_phase(options: Options, withdrawal_cost: Callable[[], float]) -> RunPhase:
    """Return the phase that decides which robots withdraw from a team without a solution.

    Its protocol has no settings, since the user has not chosen it. For the arguments see `first_phase`.
    """
    name = DEFAULT_COST_PROTOCOL if options.withdraw == Withdrawal.MINIMUM else FIRST_FIT
    protocol = protocol_or_stage(name)
    cost = withdrawal_cost() if protocol.traits.costs else None
    parameters = RunParameters(options.seed, withdrawal_cost=cost, message_loss=options.dropped)
    return RunPhase(name, protocol, parameters, withdrawal=True, takes_over=True)


MOST_REPAIRED = 300
"""The largest number of variables of a team that is repaired. Larger teams take long: 1,000 robots 12 s of CPU."""


def repair_phase(options: Options, values: StartValues) -> RunPhase:
    """Return the phase that repairs the assignment `values`, which violates hard constraints."""
    parameters = RunParameters(options.seed, {"scope": "C"}, message_loss=options.dropped)
    return RunPhase(REPAIR, protocol_or_stage(REPAIR), parameters).beginning_with(Start(values))
