"""What a run refuses before any robot starts: one sentence that says what does not fit, and what would."""

from __future__ import annotations

from dataclasses import replace

from robochoc.communication.host import SettingsError, settings_of
from robochoc.model.change import team_after_events
from robochoc.model.problem import ConstraintModel, ProblemKind, Team
from robochoc.protocols.first_fit import FirstFit
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits
from robochoc.run.options import CENTRAL, OnLoss, Options, Runtime, ScheduleName, Withdrawal
from robochoc.run.registry import offers
from robochoc.solver.encoding import UnsupportedError
from robochoc.solver.exact_costs import EXACT, check_exact
from robochoc.solver.weighted import MAX_TOTAL_COST
from robochoc.verification.objective import withdrawal_cost

PAIR = 2
LARGEST = 2**62
"""Costs that add up to more are refused: a message holds integers of 64 bits."""


class _UnfitError(UnsupportedError):
    """What does not fit is the protocol: another one may do. `complete`: if it proves what it finds."""

    def __init__(self, why: str, *, complete: bool = False) -> None:
        super().__init__(why)
        self.complete = complete


def refuse_unfit(team: Team, options: Options, protocol: type[Protocol]) -> None:
    """Raise `UnsupportedError` for what the options ask for and the protocol, or this version, cannot do."""
    try:
        settings_of(protocol, options.settings)
    except SettingsError as wrong:
        raise UnsupportedError(f"--set: {wrong} (protocol {options.protocol})") from None
    try:
        _check(team, options, protocol.traits)
    except _UnfitError as unfit:
        raise UnsupportedError(f"{unfit}{instead(team, options, complete=unfit.complete)}") from None


def instead(team: Team, options: Options, *, complete: bool = False, costs: bool = False) -> str:
    """Who takes what the protocol of `options` has refused, or what else would help, to be put behind the reason.

    Each protocol is asked as if it had been chosen. Only those count that are `complete`, or know `costs`, if need be.
    """
    names = [
        offer.name
        for offer in offers()
        if offer.protocol
        and offer.name != options.protocol
        and offer.protocol.traits.complete >= complete
        and offer.protocol.traits.costs >= costs
        and _takes(team, replace(options, protocol=offer.name), offer.protocol.traits)
    ]
    if names:
        return f"; these do: {', '.join(names)} (--protocol)"
    if _judge_takes(team, options):
        return f"; no protocol does, but the central judge (--protocol {CENTRAL})"
    dear = _most(team, aside=options.withdraw is not None) >= EXACT
    return f"; no protocol that is installed does{' (scale the costs down)' if dear else ''}"


def _takes(team: Team, options: Options, traits: Traits) -> bool:
    """Whether a protocol with these traits would take the team, in the search as well."""
    try:
        _check(team, options, traits)
        if traits.tables:
            check_exact(_most(team, aside=options.withdraw is not None))
    except UnsupportedError:
        return False
    return True


def _judge_takes(team: Team, options: Options) -> bool:
    """Whether the central judge would, for sure."""
    for_robots = (options.order, options.messages, options.channel, options.settings, options.filters)
    elsewhere = options.runtime is not Runtime.PROCESSES or options.on_loss is not OnLoss.FAIL
    if elsewhere or any((*for_robots, options.verify, options.patience)):
        return False
    try:
        refuse_central(team, replace(options, protocol=CENTRAL))
    except UnsupportedError:
        return False
    return _most(team, aside=options.withdraw is not None) <= MAX_TOTAL_COST


def _check(team: Team, options: Options, traits: Traits) -> None:
    """Raise `_UnfitError` where another protocol could do it, and `UnsupportedError` where none could."""
    _refuse_channel(options)
    if options.withdraw is not None:
        refuse_scenario(team, "--withdraw")
    if traits.costs or options.withdraw is Withdrawal.FEWEST:
        for events in range(len(team.scenario) + 1):
            _refuse_dear(team_after_events(team, events), aside=options.withdraw is not None)
    if options.withdraw is Withdrawal.FEWEST:
        _refuse_fewest(team, options, traits)
    else:
        for events in range(len(team.scenario) + 1):
            refuse(team_after_events(team, events), options.protocol, traits)
    if options.withdraw is Withdrawal.MAXIMAL:
        if team.kind is ProblemKind.DISWCSP:
            raise UnsupportedError(
                f"{team.name} is a DisWCSP; --withdraw maximal knows no costs, --withdraw fewest does"
            )
        refuse(team, "--withdraw maximal", FirstFit.traits)
    if options.spares:
        refuse(team, "--spare", Traits(costs=True))
    _refuse_network(team, options)


def _refuse_network(team: Team, options: Options) -> None:
    """What a run on a network cannot do, or only that can."""
    if options.runtime is Runtime.NETWORK:
        refuse_scenario(team, "--runtime network")
        if options.spares:
            raise UnsupportedError("--spare starts processes of this machine again; drop --runtime network")
    elif options.filters:
        raise UnsupportedError("--filter is for messages that cross a network; add --runtime network")


def refuse_central(team: Team, options: Options) -> None:
    """Raise `UnsupportedError` for what the options ask of the central judge and it does not do."""
    refuse(team, options.protocol, Traits(partially_known=True, costs=True))
    if options.count:
        refuse_scenario(team, "--count")
        if team.kind is ProblemKind.DISWCSP:
            raise UnsupportedError(
                f"{team.name} is a DisWCSP, where every assignment that breaks nothing hard is a solution; --count is"
                " for problems without costs"
            )
        if options.withdraw is not None:
            raise UnsupportedError("--count is of solutions for all robots; --withdraw asks who can do without")
    if options.withdraw is not None:
        refuse_scenario(team, "--withdraw")
    if options.withdraw is Withdrawal.MAXIMAL:
        raise UnsupportedError(
            "--withdraw maximal is settled by the robots, in priority order; the central judge finds the fewest"
            " (--withdraw fewest)"
        )


def refuse_field(team: Team, options: Options) -> None:
    """Raise `UnsupportedError` for what cannot be had of a problem that changes with its robots' situation."""
    asked = {
        "--protocol central": options.protocol == CENTRAL,
        "--withdraw": options.withdraw is not None,
        "--runtime network": options.runtime is Runtime.NETWORK,
    }
    for option in (name for name, given in asked.items() if given):
        raise UnsupportedError(
            f"{team.name} is to change with its robots' situation; {option} is for problems that do not change so"
        )


def refuse_scenario(team: Team, option: str) -> None:
    """Raise `UnsupportedError` when the problem changes over time."""
    if team.dynamic:
        raise UnsupportedError(f"{team.name} has a scenario.xml; {option} is for problems that do not change")


def refuse(team: Team, name: str, traits: Traits) -> None:
    """Raise `UnsupportedError` for what whoever is called `name` cannot take of `team`."""
    if team.kind is ProblemKind.DISWCSP and not traits.costs:
        raise _UnfitError(f"{team.name} is a DisWCSP, and {name} does not minimise costs")
    for robot in team.robots:
        parts = (part for child in robot.children for part in child.constraints)
        for constraint in (*robot.shared, *parts):
            if constraint.model is ConstraintModel.PKC and not traits.partially_known:
                raise _UnfitError(
                    f"{robot.name} shares a partially known constraint (PKC, {constraint.name}), which {name}"
                    " does not support"
                )
            if not traits.n_ary and len({team.owner[variable] for variable in constraint.variables}) > PAIR:
                raise _UnfitError(
                    f"{robot.name} holds a constraint over more than two robots ({constraint.name}), which {name}"
                    " does not support"
                )


def _refuse_channel(options: Options) -> None:
    """A channel model is another schedule of the simulator."""
    if options.channel and options.runtime is not Runtime.SIMULATOR:
        raise UnsupportedError("a channel model (--channel) is the simulator's; add --runtime simulator")
    if options.channel and (options.delay or options.schedule is not ScheduleName.CONCURRENT):
        raise UnsupportedError("a channel model (--channel) says how long messages take; drop --delay and --schedule")


def _refuse_fewest(team: Team, options: Options, traits: Traits) -> None:
    """Who steps aside is a question of costs: a protocol for these answers it alone, any other is asked first."""
    if traits.costs and not traits.complete:
        raise _UnfitError(f"--withdraw fewest has to be proven, and {options.protocol} proves nothing", complete=True)
    if team.kind is ProblemKind.DISCSP:
        refuse(team, options.protocol, traits)
    refuse(team, "--withdraw fewest", Traits(costs=True, n_ary=traits.n_ary or not traits.costs))


def _refuse_dear(team: Team, *, aside: bool) -> None:
    """Costs, and what stepping aside costs, must fit into messages, however they add up."""
    most = _most(team, aside=aside)
    if most >= LARGEST:
        raise UnsupportedError(f"{team.name}'s costs could add up to {most:,}, more than {LARGEST:,}; scale them down")


def _most(team: Team, *, aside: bool) -> float:
    """What costs could add up to, with those of stepping aside if robots may."""
    return withdrawal_cost(team) * (sum(robot.weight for robot in team.robots) + 1 if aside else 1)
