"""Options that do not go together, whatever the problem is."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from robochoc.run.defaults import CENTRAL, MOST_LOSS
from robochoc.run.options import CentralSolverName, OnLoss, Options, Runtime, ScheduleName, Withdrawal
from robochoc.solver.errors import UnsupportedError

LEAST_SEED, LARGEST_SEED = -(2**63), 2**64 - 1
"""Journals and robots on a network receive the seed in msgpack, whose integers are at most this long."""


class OptionRule(NamedTuple):
    """Options that are refused: the condition, the reason, and what to do instead."""

    refuses: Callable[[Options], object]
    why: str
    instead: str = ""


def _for_robots(option: str, given: Callable[[Options], object]) -> OptionRule:
    """Return the rule that the central solver has no use for an option."""
    why = f"{option} is for robots that solve it together, not for --protocol central"
    return OptionRule(lambda o: o.protocol == CENTRAL and given(o), why)


def _not_while_changing(option: str, given: Callable[[Options], object]) -> OptionRule:
    """Return the rule that an option is not for problems that change with the robots' situation."""
    return OptionRule(given, f"{option} is for problems that do not change; --situation changes this one")


def _is_delayed(options: Options) -> bool:
    """Return whether messages are delayed, or ordered, otherwise than by default."""
    return bool(options.delay) or options.schedule != ScheduleName.CONCURRENT


_WITHOUT_PROCESSES = frozenset({Runtime.SIMULATOR, Runtime.ARRAYS})

OPTION_RULES = (
    OptionRule(lambda o: not LEAST_SEED <= o.seed <= LARGEST_SEED, "--seed is a number of 64 bits: less than 2^64"),
    OptionRule(
        lambda o: o.channel and o.runtime != Runtime.SIMULATOR,
        "--channel is the simulator's",
        "add --runtime simulator",
    ),
    OptionRule(
        lambda o: o.channel and _is_delayed(o),
        "--channel says how long messages take",
        "drop --delay and --schedule",
    ),
    OptionRule(
        lambda o: _is_delayed(o) and o.runtime != Runtime.SIMULATOR,
        "--delay and --schedule are the simulator's",
        "add --runtime simulator",
    ),
    OptionRule(
        lambda o: o.delay and o.schedule in {ScheduleName.CYCLES, ScheduleName.RANDOM},
        "--delay is for --schedule concurrent: in a random one any message may take any time, in cycles each takes one",
    ),
    OptionRule(lambda o: o.deadline and o.timeout, "--deadline and --timeout both limit the time: give one of them"),
    OptionRule(lambda o: o.improve and not o.deadline, "--improve goes on after --deadline SECONDS: add it"),
    OptionRule(lambda o: not 0 <= o.message_loss <= MOST_LOSS, "--message-loss is a probability from 0 to 0.9"),
    OptionRule(
        lambda o: o.loss and (o.runtime == Runtime.ARRAYS or o.preprocess or o.wants_anytime),
        "--message-loss cannot be used with --runtime arrays, --preprocess or --set anytime=yes",
    ),
    OptionRule(
        lambda o: o.ncccs is not None and o.runtime != Runtime.SIMULATOR,
        "--ncccs is a limit for the simulator, which knows all clocks",
        "add --runtime simulator",
    ),
    OptionRule(
        lambda o: o.cycles is not None and o.schedule != ScheduleName.CYCLES,
        "--cycles is a limit on the simulator's cycles",
        "add --runtime simulator --schedule cycles (a local search has its own number of cycles: --set cycles=N)",
    ),
    OptionRule(
        lambda o: o.protocol == CENTRAL and o.verify,
        "--verify asks the central solver, which is --protocol central itself",
    ),
    OptionRule(
        lambda o: o.patience is not None and (o.protocol == CENTRAL or o.runtime in _WITHOUT_PROCESSES),
        "--patience is for robots with processes, which can be stopped",
        "drop it",
    ),
    _for_robots("--messages", lambda o: o.messages),
    _for_robots("--ncccs", lambda o: o.ncccs is not None),
    _for_robots("--cycles", lambda o: o.cycles is not None),
    _for_robots("--on-loss", lambda o: o.on_loss),
    _for_robots("--spare", lambda o: o.spares),
    _for_robots("--kill", lambda o: o.kill),
    _for_robots("--channel", lambda o: o.channel),
    _for_robots("--deadline", lambda o: o.deadline),
    _for_robots("--message-loss", lambda o: o.message_loss),
    _for_robots("--filter", lambda o: o.filters),
    _for_robots("--bounds", lambda o: o.bounds),
    _for_robots("--order", lambda o: o.order is not None),
    _for_robots("--set", lambda o: o.settings),
    _for_robots("--preprocess", lambda o: o.preprocess),
    OptionRule(
        lambda o: o.preprocess and o.runtime in {Runtime.NETWORK, Runtime.ARRAYS},
        "--preprocess is of robots in processes or the simulator",
        "drop it",
    ),
    OptionRule(
        lambda o: o.protocol == CENTRAL and o.withdraw == Withdrawal.MAXIMAL,
        "--withdraw maximal is settled by the robots, in priority order; the central solver finds a minimum",
        "--withdraw minimum",
    ),
    OptionRule(
        lambda o: o.central_with != CentralSolverName.ACE and o.protocol != CENTRAL,
        "--with says who decides one model of all files",
        "add --protocol central",
    ),
    OptionRule(
        lambda o: o.central_with == CentralSolverName.ORTOOLS and o.count,
        "--count is of ACE's solutions; OR-Tools does not count",
        "drop --with",
    ),
    OptionRule(
        lambda o: o.count and o.withdraw is not None,
        "--count is of solutions for all robots; --withdraw asks who can do without",
    ),
    OptionRule(
        lambda o: o.filters and o.runtime != Runtime.NETWORK,
        "--filter is for messages that cross a network",
        "add --runtime network",
    ),
    OptionRule(
        lambda o: o.bounds and o.runtime in {Runtime.NETWORK, Runtime.ARRAYS},
        "--bounds is of robots in processes or the simulator",
        "drop it",
    ),
    OptionRule(
        lambda o: o.spares and o.runtime == Runtime.NETWORK,
        "--spare starts processes of this machine again",
        "drop --runtime network",
    ),
    OptionRule(
        lambda o: (o.on_loss or o.spares) and o.runtime in _WITHOUT_PROCESSES,
        "--on-loss and --spare are for processes, which can die",
        "drop --runtime, or write a scenario.xml",
    ),
    OptionRule(
        lambda o: o.kill and o.runtime in _WITHOUT_PROCESSES,
        "--kill ends a robot's process, and the simulator and arrays have none",
        "drop --runtime",
    ),
    OptionRule(
        lambda o: o.spares and o.on_loss == OnLoss.FAIL,
        "--spare brings robots back that died; --on-loss fail ends the run instead",
    ),
    OptionRule(
        lambda o: o.withdraw is not None and o.protocol != CENTRAL and o.runtime == Runtime.ARRAYS,
        "--withdraw is settled by protocols that have no form as arrays",
        "add --runtime simulator",
    ),
)
"""Combinations of options that are refused for every problem."""

ENVIRONMENT_RULES = (
    _not_while_changing("--protocol central", lambda o: o.protocol == CENTRAL),
    _not_while_changing("--withdraw", lambda o: o.withdraw is not None),
    _not_while_changing("--runtime network", lambda o: o.runtime == Runtime.NETWORK),
    _not_while_changing("--runtime arrays", lambda o: o.runtime == Runtime.ARRAYS),
    _not_while_changing("--preprocess", lambda o: o.preprocess),
)
"""Further combinations that are refused if an environment changes the problem."""

PRIVATE_RULES = (
    OptionRule(
        lambda o: o.deadline,
        "--deadline uses checked values, and --private hides the values that would be checked",
        "--timeout",
    ),
)
"""Further combinations that are refused if robots keep their values to themselves."""


def refuse_options(options: Options, *, environment: bool = False, private: bool = False) -> None:
    """Raise `UnsupportedError` for options that do not go together.

    `environment`: one changes the problem. `private`: robots keep their values to themselves.
    """
    for rule in (*ENVIRONMENT_RULES * environment, *PRIVATE_RULES * private, *OPTION_RULES):
        if rule.refuses(options):
            raise UnsupportedError("; ".join(filter(None, [rule.why, rule.instead])))
