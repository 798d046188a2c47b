"""What a run refuses before any robot starts: one sentence that says what does not fit, and what would."""

from __future__ import annotations

from collections.abc import Callable

from robochoc.change import changed_by
from robochoc.communication.host import BadSettings, settings_of
from robochoc.observers.objective import aside_cost
from robochoc.options import CENTRAL, Options, Runtime, ScheduleName, Withdrawal
from robochoc.problem import Kind, Model, Team
from robochoc.protocols.first_fit import FirstFit
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits
from robochoc.registry import offers
from robochoc.solver.encoding import Unsupported

PAIR = 2
LARGEST = 2**62
"""Costs that add up to more are refused: a message holds integers of 64 bits."""


def refuse_unfit(team: Team, options: Options, protocol: type[Protocol]) -> None:
    """Raise `Unsupported` for what the options ask for and the protocol, or this version, cannot do."""
    traits = protocol.traits
    _refuse_channel(options)
    try:
        settings_of(protocol, options.settings)
    except BadSettings as wrong:
        raise Unsupported(f"--set: {wrong} (protocol {options.protocol})") from None
    if options.withdraw is not None:
        refuse_scenario(team, "--withdraw")
    if traits.costs or options.withdraw is Withdrawal.FEWEST:
        for events in range(len(team.scenario) + 1):
            _refuse_dear(changed_by(team, events), aside=options.withdraw is not None)
    if options.withdraw is Withdrawal.FEWEST:
        _refuse_fewest(team, options, traits)
    else:
        for events in range(len(team.scenario) + 1):
            refuse(changed_by(team, events), options.protocol, traits)
    if options.withdraw is Withdrawal.MAXIMAL:
        if team.kind is Kind.DISWCSP:
            raise Unsupported(f"{team.name} is a DisWCSP; --withdraw maximal knows no costs, --withdraw fewest does")
        refuse(team, "--withdraw maximal", FirstFit.traits)
    if options.spares:
        refuse(team, "--spare", Traits(costs=True))
    _refuse_network(team, options)


def _refuse_network(team: Team, options: Options) -> None:
    """What a run on a network cannot do, or only that can."""
    if options.runtime is Runtime.NETWORK:
        refuse_scenario(team, "--runtime network")
        if options.spares:
            raise Unsupported("--spare starts processes of this machine again; drop --runtime network")
    elif options.filters:
        raise Unsupported("--filter is for messages that cross a network; add --runtime network")


def refuse_central(team: Team, options: Options) -> None:
    """Raise `Unsupported` for what the options ask of the central judge and it does not do."""
    refuse(team, options.protocol, Traits(partially_known=True, costs=True))
    if options.count:
        refuse_scenario(team, "--count")
        if team.kind is Kind.DISWCSP:
            raise Unsupported(
                f"{team.name} is a DisWCSP, where every assignment that breaks nothing hard is a solution; --count is"
                " for problems without costs"
            )
        if options.withdraw is not None:
            raise Unsupported("--count is of solutions for all robots; --withdraw asks who can do without")
    if options.withdraw is not None:
        refuse_scenario(team, "--withdraw")
    if options.withdraw is Withdrawal.MAXIMAL:
        raise Unsupported(
            "--withdraw maximal is settled by the robots, in priority order; the central judge finds the fewest"
            " (--withdraw fewest)"
        )


def refuse_field(team: Team, options: Options) -> None:
    """Raise `Unsupported` for what cannot be had of a problem that changes with its robots' situation."""
    asked = {
        "--protocol central": options.protocol == CENTRAL,
        "--withdraw": options.withdraw is not None,
        "--runtime network": options.runtime is Runtime.NETWORK,
    }
    for option in (name for name, given in asked.items() if given):
        raise Unsupported(
            f"{team.name} is to change with its robots' situation; {option} is for problems that do not change so"
        )


def refuse_scenario(team: Team, option: str) -> None:
    """Raise `Unsupported` when the problem changes over time."""
    if team.dynamic:
        raise Unsupported(f"{team.name} has a scenario.xml; {option} is for problems that do not change")


def refuse(team: Team, name: str, traits: Traits) -> None:
    """Raise `Unsupported` for what whoever is called `name` cannot take of `team`."""
    if team.kind is Kind.DISWCSP and not traits.costs:
        raise Unsupported(
            f"{team.name} is a DisWCSP, and {name} does not minimise costs; {_who_takes(lambda other: other.costs)}"
        )
    for robot in team.robots:
        parts = (part for child in robot.children for part in child.constraints)
        for constraint in (*robot.shared, *parts):
            if constraint.model is Model.PKC and not traits.partially_known:
                raise Unsupported(
                    f"{robot.name} shares a partially known constraint (PKC, {constraint.name}), which {name}"
                    f" does not support{_instead_of(name, lambda other: other.partially_known)}"
                )
            if not traits.n_ary and len({team.owner[variable] for variable in constraint.variables}) > PAIR:
                raise Unsupported(
                    f"{robot.name} holds a constraint over more than two robots ({constraint.name}), which {name}"
                    f" does not support{_instead_of(name, lambda other: other.n_ary)}"
                )


def instead(team: Team, name: str) -> str:
    """The complete protocols that minimise and can take `team`, without the one called `name`."""

    def fits(other: str, traits: Traits) -> bool:
        try:
            refuse(team, other, traits)
        except Unsupported:
            return False
        return other != name and traits.costs and traits.complete

    names = [offer.name for offer in offers() if offer.protocol and fits(offer.name, offer.protocol.traits)]
    return f"; these would do: {', '.join(names)} (--protocol)" if names else ""


def _refuse_channel(options: Options) -> None:
    """A channel model is another schedule of the simulator."""
    if options.channel and options.runtime is not Runtime.SIMULATOR:
        raise Unsupported("a channel model (--channel) is the simulator's; add --runtime simulator")
    if options.channel and (options.delay or options.schedule is not ScheduleName.CONCURRENT):
        raise Unsupported("a channel model (--channel) says how long messages take; drop --delay and --schedule")


def _refuse_fewest(team: Team, options: Options, traits: Traits) -> None:
    """Who steps aside is a question of costs: a protocol for these answers it alone, any other is asked first."""
    if traits.costs and not traits.complete:
        raise Unsupported(
            f"--withdraw fewest has to be proven, and {options.protocol} proves nothing;"
            f" {_who_takes(lambda other: other.costs and other.complete)}"
        )
    if team.kind is Kind.DISCSP:
        refuse(team, options.protocol, traits)
    refuse(team, "--withdraw fewest", Traits(costs=True, n_ary=traits.n_ary or not traits.costs))


def _refuse_dear(team: Team, *, aside: bool) -> None:
    """Costs, and what stepping aside costs, must fit into messages, however they add up."""
    most = aside_cost(team) * (sum(robot.weight for robot in team.robots) + 1 if aside else 1)
    if most >= LARGEST:
        raise Unsupported(f"{team.name}'s costs could add up to {most:,}, more than {LARGEST:,}; scale them down")


def _instead_of(name: str, fits: Callable[[Traits], bool]) -> str:
    """Who could do it instead of the protocol called `name`; an option has no such stand-in."""
    return "" if name.startswith("--") else f"; {_who_takes(fits)}"


def _who_takes(fits: Callable[[Traits], bool]) -> str:
    names = [offer.name for offer in offers() if offer.protocol and fits(offer.protocol.traits)]
    return f"these do: {', '.join(names)} (--protocol)"
