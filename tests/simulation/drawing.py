"""A seed becomes a plan: problem, protocol, options and faults, as far as they can be combined."""

from __future__ import annotations

import math
import typing
from collections.abc import Callable, Iterator
from dataclasses import replace
from random import Random

import msgspec

from robochoc.communication.kill_schedule import Kill
from robochoc.communication.simulator.channel import CHANNELS, ChannelModel
from robochoc.communication.simulator.loss_models import Bursts
from robochoc.model.costs import normalized
from robochoc.model.problem import Team
from robochoc.protocols.traits import Traits
from robochoc.run import Options, Runtime, ScheduleName, Withdrawal
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.compatibility.team_rules import refuse_unfit
from robochoc.run.defaults import AUTO
from robochoc.run.options import AnswerRule, OnLoss, Preprocess
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.errors import UnsupportedError
from tests.simulation.plan import Fault, FaultKind, Plan
from tests.support.asymmetric_problems import random_asymmetric_team
from tests.support.cost_problems import random_cost_team
from tests.support.encrypted_problems import affordable
from tests.support.loose_problems import any_order, loose_team
from tests.support.random_changes import random_changing_team

MOST_ASSIGNMENTS = 2_000
"""Assignments that brute force tries for one team."""
MOST_MESSAGES = 2_000
"""Messages after which an incomplete protocol without an end of its own is stopped."""
PROTOCOLS = tuple(name for name in protocol_names() if protocol_named(name).__module__.startswith("robochoc."))
TRAITOR_S = 100.0
"""The virtual seconds of a run with a traitor, who may keep it going for ever."""
HOUR_S, DAY_S = 3_600.0, 86_400.0


def drawn_plan(seed: int) -> Plan:
    """Return the plan that `seed` decides."""
    chance = Random(f"simulation {seed}")
    runtime = chance.choice((Runtime.SIMULATOR, Runtime.SIMULATOR, Runtime.PROCESSES, Runtime.NETWORK))
    protocol = AUTO if runtime != Runtime.NETWORK and chance.random() < 0.05 else chance.choice(PROTOCOLS)
    like = chance.choice(("abt", "syncbb")) if protocol == AUTO else protocol
    traits = protocol_named(like).traits
    team = _team(like, traits, chance, changes=runtime != Runtime.NETWORK)
    options = _options(team, protocol, traits, runtime, chance)
    if runtime == Runtime.SIMULATOR:
        plan = Plan(seed, team, options, tuple(_faults(HOUR_S, chance)), tick_s=10 ** chance.uniform(-4, 1.5))
        return _with_environment(plan, chance)
    scale_s = chance.choice((0.01, 0.1, 1.0, 10.0) if runtime == Runtime.PROCESSES else (0.01, 0.1, 1.0, 3.0))
    faults = (*_faults(scale_s, chance), *_faults_of_robots(team, scale_s, chance))
    if runtime == Runtime.NETWORK:
        faults, options = _faults_of_network(team, options, faults, chance)
    plan = Plan(seed, _named_files(team), options, faults, tick_s=1e-6, delay_s=scale_s * chance.random())
    return _secured(plan, scale_s, chance) if runtime == Runtime.NETWORK else _with_environment(plan, chance)


def _with_environment(plan: Plan, chance: Random) -> Plan:
    """Return `plan`, sometimes with an environment in place of its scenario."""
    if not plan.team.scenario or chance.random() < 0.5:
        return plan
    return _unless_refused(plan, replace(plan, environment=True))


def _secured(plan: Plan, scale_s: float, chance: Random) -> Plan:
    """Return `plan` with filters of messages, hidden values and revoked names, sometimes."""
    if chance.random() < 0.15:
        options = replace(plan.options, filters=chance.choice((("signed",), ("sealed",), ("signed", "sealed"))))
        plan = _unless_refused(plan, replace(plan, options=options))
    if chance.random() < 0.1:
        plan = _unless_refused(plan, replace(plan, private=True))
    if chance.random() < 0.1:
        fault = Fault(FaultKind.REVOKE, chance.choice(plan.team.order), _moment(scale_s, chance))
        plan = replace(plan, faults=(*plan.faults, fault))
    return plan


def _unless_refused(plan: Plan, changed: Plan) -> Plan:
    """Return `changed`, or `plan` if the options of the former cannot be combined."""
    try:
        refuse_options(changed.options, environment=changed.environment, private=changed.private)
    except UnsupportedError:
        return plan
    return changed


# The problem


def _team(protocol: str, traits: Traits, chance: Random, *, changes: bool) -> Team:
    while True:
        team = affordable(protocol, lambda: _maker(protocol, traits, chance, changes=changes)(chance))
        if math.prod(len(variable.domain) for variable in team.variables.values()) <= MOST_ASSIGNMENTS:
            return team


def _maker(protocol: str, traits: Traits, chance: Random, *, changes: bool) -> Callable[[Random], Team]:
    """Return a function that draws a team of a kind that the protocol can solve, without a central solver."""
    makers: list[Callable[[Random], Team]] = [lambda chance: loose_team(protocol, chance)]
    if traits.costs:
        makers += [lambda chance: loose_team(protocol, chance, costs=True)] * 2
    if traits.costs and traits.n_ary and not traits.allocates:
        makers.append(random_cost_team)
    if traits.n_ary and not traits.allocates and changes:
        makers += [lambda chance: random_changing_team(chance, chance.randint(1, 4))] * (3 if traits.dynamic else 1)
    if traits.asymmetric:
        makers += [lambda chance: random_asymmetric_team(chance, simple=True)] * 3
    return chance.choice(makers)


def _named_files(team: Team) -> Team:
    """Return `team`, whose robots' files are called as the robots are: a robot that returns is read again."""
    return replace(team, robots=tuple(replace(robot, file=robot.name) for robot in team.robots))


# The options


def _options(team: Team, protocol: str, traits: Traits, runtime: Runtime, chance: Random) -> Options:
    """Return options at random, of which each can be combined with those before it and with the team."""
    options = Options(
        protocol=protocol,
        runtime=runtime,
        seed=chance.getrandbits(32),
        cache=False,
        order=any_order(team, chance),
        settings=_settings(protocol, chance),
        messages=None if traits.complete or chance.random() < 0.3 else MOST_MESSAGES,
    )
    wanted = [change for share, change in _wanted(team, runtime, chance) if chance.random() < share]
    chance.shuffle(wanted)
    for change in wanted:
        changed = replace(options, **change)
        if not is_refused(team, changed):
            options = changed
    return options


def _wanted(team: Team, runtime: Runtime, chance: Random) -> Iterator[tuple[float, dict[str, typing.Any]]]:
    """Yield options with values at random, and how often each is used."""
    span_s = 10 ** chance.uniform(-1, 5 if runtime == Runtime.SIMULATOR else 2)
    yield 0.1, {"deadline": span_s}
    yield 0.1, {"deadline": span_s, "improve": span_s * chance.choice((0.1, 1, 10))}
    yield 0.03, {"timeout": span_s}
    yield 0.1, {"answer": AnswerRule.FINAL}
    yield 0.1, {"repair": False}
    yield 0.3, {"withdraw": Withdrawal.MINIMUM}
    yield 0.2, {"withdraw": Withdrawal.MAXIMAL}
    yield 0.2, {"count": True}
    yield 0.07, {"messages": chance.choice((0, 1, 10, 50, 300))}
    yield 0.2, {"preprocess": Preprocess.AC}
    yield 0.3, {"start": _start(team, chance)}
    yield 0.2, {"cold": True}
    yield 0.2, {"bounds": True}
    yield 0.15, {"message_loss": chance.choice((0.01, 0.1, 0.5))}
    if runtime == Runtime.SIMULATOR:
        yield 0.3, {"schedule": chance.choice([*ScheduleName])}
        yield 0.2, {"schedule": ScheduleName.RANDOM}
        yield 0.2, {"delay": chance.choice((3, 20, 200))}
        yield 0.4, {"channel": _channel(chance)}
        yield 0.03, {"ncccs": chance.choice((0, 10, 100))}
        yield 0.05, {"schedule": ScheduleName.CYCLES, "cycles": chance.choice((1, 5, 30))}
    else:
        yield 0.2, {"on_loss": OnLoss.FAIL}
        yield 0.5, {"on_loss": OnLoss.WITHDRAW}
        yield 0.3, {"spares": chance.randint(1, 3)}
        least = 1 if runtime == Runtime.NETWORK else -1  # robots in a network need more patience than their delays
        yield 0.3, {"patience": 10 ** chance.uniform(least, 4)}
        if runtime == Runtime.NETWORK:
            return
        kills = [Kill(chance.choice(team.order), 10 ** chance.uniform(-3, 2)) for _ in range(chance.randint(1, 2))]
        yield 0.3, {"kill": tuple(kills)}


def is_refused(team: Team, options: Options) -> bool:
    """Return whether the options cannot be combined with each other or with the team."""
    try:
        refuse_options(options)
        if options.protocol != AUTO:
            refuse_unfit(normalized(team), options, protocol_named(options.protocol).traits)
    except UnsupportedError:
        return True
    return False


def _start(team: Team, chance: Random) -> dict[str, int | None]:
    share = chance.choice((0.5, 1.0))
    return {
        name: chance.choice([*one.domain, *[None] * (chance.random() < 0.1)])
        for name, one in team.variables.items()
        if one.domain and chance.random() < share
    }


def _channel(chance: Random) -> ChannelModel:
    """Return a model: one that is shipped, or one with latencies up to hours and with lost messages."""
    if chance.random() < 0.3:
        return chance.choice([*CHANNELS.values()])
    latency_ms = 10 ** chance.uniform(0, 4.5)
    return ChannelModel(
        name="drawn",
        latency_ms=latency_ms,
        minimum_ms=latency_ms * chance.random(),
        sigma=chance.choice((0, 1, 2)),
        loss=chance.choice((0, 0.1, 0.5)),
        shared=chance.random() < 0.5,
        message_loss=0.1 if chance.random() < 0.1 else 0,
        bursts=Bursts(begin=0.05, end=0.3, loss=0.9) if chance.random() < 0.15 else None,
        check_ns=chance.choice((1_000, 10**6)),
    )


def _settings(protocol: str, chance: Random) -> dict[str, str]:
    """Return settings of the protocol: few cycles, and any of the variants that it has."""
    if protocol == AUTO:
        return {}
    kind = type(protocol_named(protocol).settings)
    found = {}
    for field in msgspec.structs.fields(kind):
        if field.name == "cycles":
            found["cycles"] = str(chance.choice((3, 8, 20)))
        elif typing.get_origin(field.type) is typing.Literal and chance.random() < 0.3:
            found[field.name] = str(chance.choice(typing.get_args(field.type)))
    if protocol in {"adopt-k", "rmb-dpop", "mb-dpop", "hs-cai"} and chance.random() < 0.3:
        found["k"] = str(chance.randint(1, 3))
    return found


# The faults


def _faults(scale_s: float, chance: Random) -> Iterator[Fault]:
    """Yield faults that can happen in every runtime."""
    if chance.random() < 0.2:
        yield Fault(FaultKind.CLOCK, at_s=_moment(scale_s, chance), for_s=chance.choice((1.0, HOUR_S, DAY_S)))
    if chance.random() < 0.2:
        yield Fault(FaultKind.DISK, size=chance.choice((0, 1, 200, 2_000, 20_000)))


def _faults_of_robots(team: Team, scale_s: float, chance: Random) -> Iterator[Fault]:
    """Yield faults of robots that run as processes."""
    names = team.order
    span_s = scale_s * 10 ** chance.uniform(-1, 1.5)
    shares = {FaultKind.CRASH: 0.2, FaultKind.STOP: 0.2, FaultKind.SLOW: 0.2, FaultKind.PARTITION: 0.2}
    for kind, share in shares.items():
        while chance.random() < share:
            yield Fault(kind, chance.choice(names), _moment(scale_s, chance), span_s)
    if chance.random() < 0.05:
        yield Fault(FaultKind.GARBLE, chance.choice(names), size=chance.randint(1, 20))


def _faults_of_network(
    team: Team, options: Options, faults: tuple[Fault, ...], chance: Random
) -> tuple[tuple[Fault, ...], Options]:
    """Return the faults that can happen in a network, and options that limit the time if there is a traitor."""
    faults = tuple(fault for fault in faults if fault.kind is not FaultKind.GARBLE)
    if chance.random() < 0.1:
        faults = (*faults, Fault(FaultKind.LOSS, chance.choice(team.order), chance.random(), size=chance.randint(1, 5)))
    if chance.random() < 0.2:
        faults = (*faults, Fault(FaultKind.LIE, chance.choice(team.order), size=chance.randrange(100)))
        if options.limit_s is None:
            options = replace(options, timeout=TRAITOR_S)
    return faults, options


def _moment(scale_s: float, chance: Random) -> float:
    return scale_s * 10 ** chance.uniform(-2, 2)
