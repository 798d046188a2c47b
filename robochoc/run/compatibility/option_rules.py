"""Options that cannot be combined, whatever the problem is."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from robochoc.model.policies import Risk
from robochoc.run.defaults import CENTRAL, MOST_LOSS, MOST_STANDBYS
from robochoc.run.options import AnswerRule, CentralSolverName, OnLoss, Options, Runtime, ScheduleName, Withdrawal
from robochoc.solver.errors import UnsupportedError

LEAST_SEED, LARGEST_SEED = -(2**63), 2**64 - 1
"""The range of seeds. Journals and robots on a network receive the seed in msgpack, whose integers have this range."""


class OptionRule(NamedTuple):
    """A combination of options that is refused: the condition, the reason, and an alternative."""

    refuses: Callable[[Options], object]
    why: str
    instead: str = ""


def _for_robots(option: str, given: Callable[[Options], object]) -> OptionRule:
    """Return the rule that refuses to combine an option with the central solver."""
    why = f"{option} is for robots that solve the problem together, not for --protocol central"
    return OptionRule(lambda o: o.protocol == CENTRAL and given(o), why)


def _not_while_changing(option: str, given: Callable[[Options], object]) -> OptionRule:
    """Return the rule that refuses an option for problems that an environment changes."""
    return OptionRule(given, f"{option} is for problems that do not change, but --situation changes the problem")


def _is_delayed(options: Options) -> bool:
    """Return whether the delays or the message order differ from the default."""
    return bool(options.delay) or options.schedule != ScheduleName.CONCURRENT


def _starts_programs_without(options: Options) -> bool:
    """Return whether robots run as separate programs, which do not know protocols registered by this program."""
    if options.runtime != Runtime.NETWORK:
        return False
    from robochoc.run.registry import is_registered  # noqa: PLC0415 - start-up: this runtime is rare

    return is_registered(options.protocol)


_WITHOUT_PROCESSES = frozenset({Runtime.SIMULATOR, Runtime.ARRAYS})

OPTION_RULES = (
    OptionRule(lambda o: not LEAST_SEED <= o.seed <= LARGEST_SEED, "--seed must be a 64-bit number, less than 2^64"),
    OptionRule(
        lambda o: o.channel and o.runtime != Runtime.SIMULATOR,
        "--channel is only for the simulator",
        "add --runtime simulator",
    ),
    OptionRule(
        lambda o: o.channel and _is_delayed(o),
        "--channel determines how long messages take",
        "remove --delay and --schedule",
    ),
    OptionRule(
        lambda o: _is_delayed(o) and o.runtime != Runtime.SIMULATOR,
        "--delay and --schedule are only for the simulator",
        "add --runtime simulator",
    ),
    OptionRule(
        lambda o: o.delay and o.schedule in {ScheduleName.CYCLES, ScheduleName.RANDOM},
        "--delay is only for --schedule concurrent: with random, delays are arbitrary, and with cycles one cycle",
    ),
    OptionRule(
        lambda o: o.samples and o.risk == Risk.WORST,
        "--samples estimates expected costs, not the worst case",
        "remove --samples or --risk worst",
    ),
    OptionRule(lambda o: o.deadline and o.timeout, "--deadline and --timeout both limit the time: remove one of them"),
    OptionRule(lambda o: o.improve and not o.deadline, "--improve continues after --deadline SECONDS: add --deadline"),
    OptionRule(lambda o: not 0 <= o.message_loss <= MOST_LOSS, "--message-loss must be a probability from 0 to 0.9"),
    OptionRule(
        lambda o: o.loss and (o.runtime == Runtime.ARRAYS or o.preprocess or o.wants_anytime),
        "--message-loss cannot be used with --runtime arrays, --preprocess or --set anytime=yes",
    ),
    OptionRule(
        lambda o: o.ncccs is not None and o.runtime != Runtime.SIMULATOR,
        "--ncccs is only for the simulator, which has the clocks of all robots",
        "add --runtime simulator",
    ),
    OptionRule(
        lambda o: o.cycles is not None and o.schedule != ScheduleName.CYCLES,
        "--cycles limits the cycles of the simulator",
        "add --runtime simulator --schedule cycles (a local search has its own number of cycles: --set cycles=N)",
    ),
    OptionRule(
        lambda o: o.protocol == CENTRAL and o.verify and o.count,
        "--verify confirms a no-solution or an optimum, and not the number of solutions",
        "remove --verify or --count",
    ),
    OptionRule(
        lambda o: o.patience is not None and (o.protocol == CENTRAL or o.runtime in _WITHOUT_PROCESSES),
        "--patience is only for robots that run as processes",
        "remove it",
    ),
    _for_robots("--start", lambda o: o.start),
    _for_robots("--messages", lambda o: o.messages),
    _for_robots("--ncccs", lambda o: o.ncccs is not None),
    _for_robots("--cycles", lambda o: o.cycles is not None),
    _for_robots("--on-loss", lambda o: o.on_loss),
    _for_robots("--spare", lambda o: o.spares),
    _for_robots("--kill", lambda o: o.kill),
    _for_robots("--standby", lambda o: o.standby),
    _for_robots("--channel", lambda o: o.channel),
    _for_robots("--deadline", lambda o: o.deadline),
    _for_robots("--message-loss", lambda o: o.message_loss),
    _for_robots("--filter", lambda o: o.filters),
    _for_robots("--bounds", lambda o: o.bounds),
    _for_robots("--order", lambda o: o.order is not None),
    _for_robots("--set", lambda o: o.settings),
    _for_robots("--preprocess", lambda o: o.preprocess),
    _for_robots("--answer", lambda o: o.answer != AnswerRule.BEST),
    OptionRule(
        lambda o: o.answer == AnswerRule.FINAL and o.improve is not None,
        "--improve publishes better and better answers, and cannot be used with --answer final",
        "remove one of them",
    ),
    OptionRule(
        lambda o: o.preprocess and o.runtime in {Runtime.NETWORK, Runtime.ARRAYS},
        "--preprocess is only for robots that run as processes or in the simulator",
        "remove it",
    ),
    OptionRule(
        lambda o: o.protocol == CENTRAL and o.withdraw == Withdrawal.MAXIMAL,
        "--withdraw maximal is not supported by the central solver: robots decide it, in priority order",
        "use --withdraw minimum",
    ),
    OptionRule(
        lambda o: o.central_with != CentralSolverName.AUTO and o.protocol != CENTRAL,
        "--with chooses the central solver",
        "add --protocol central",
    ),
    OptionRule(
        lambda o: o.central_with not in {CentralSolverName.AUTO, CentralSolverName.ACE} and o.count,
        "--count is only for ACE: the other central solvers find one solution",
        "remove --with",
    ),
    OptionRule(
        lambda o: o.count and o.withdraw is not None,
        "--count counts solutions for all robots, and cannot be used with --withdraw",
    ),
    OptionRule(
        _starts_programs_without,
        "--runtime network starts other programs, which do not know a protocol registered by this program",
        "add --runtime processes, or install the protocol as a package",
    ),
    OptionRule(
        lambda o: o.filters and o.runtime != Runtime.NETWORK,
        "--filter is only for messages over a network",
        "add --runtime network",
    ),
    OptionRule(
        lambda o: o.bounds and o.runtime in {Runtime.NETWORK, Runtime.ARRAYS},
        "--bounds is only for robots that run as processes or in the simulator",
        "remove it",
    ),
    OptionRule(
        lambda o: o.spares and o.runtime == Runtime.NETWORK,
        "--spare restarts only processes on this machine",
        "remove --runtime network",
    ),
    OptionRule(
        lambda o: o.standby and o.runtime != Runtime.NETWORK,
        "--standby starts masters on a network",
        "add --runtime network",
    ),
    OptionRule(
        lambda o: o.standby > MOST_STANDBYS, f"--standby starts at most {MOST_STANDBYS} masters besides the first one"
    ),
    OptionRule(
        lambda o: o.standby and (o.improve is not None or o.start or o.verify),
        "--standby cannot be used with --improve, --start or --verify",
        "remove one of them",
    ),
    OptionRule(
        lambda o: (o.on_loss or o.spares) and o.runtime in _WITHOUT_PROCESSES,
        "--on-loss and --spare are only for robots that run as processes",
        "remove --runtime, or write a scenario.xml",
    ),
    OptionRule(
        lambda o: o.kill and o.runtime in _WITHOUT_PROCESSES,
        "--kill ends a robot's process: the simulator and arrays do not use processes",
        "remove --runtime",
    ),
    OptionRule(
        lambda o: o.spares and o.on_loss == OnLoss.FAIL,
        "--spare restarts robots that died, and cannot be used with --on-loss fail",
    ),
    OptionRule(
        lambda o: o.cluster is not None and o.runtime != Runtime.ARRAYS,
        "--cluster is only for --runtime arrays",
        "add --runtime arrays",
    ),
    OptionRule(
        lambda o: o.cluster is not None and o.deadline,
        "--deadline requires values during the search, which a cluster does not send",
        "use --timeout",
    ),
    OptionRule(
        lambda o: o.withdraw is not None and o.protocol != CENTRAL and o.runtime == Runtime.ARRAYS,
        "--withdraw cannot be used with --runtime arrays",
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
        "--deadline requires the values of all robots for its check, but --private hides them",
        "use --timeout",
    ),
)
"""Further combinations that are refused if robots do not disclose their values."""


def refuse_options(options: Options, *, environment: bool = False, private: bool = False) -> None:
    """Raise `UnsupportedError` for options that cannot be combined.

    `environment`: true if an environment changes the problem. `private`: true if robots do not disclose their values.
    """
    for rule in (*ENVIRONMENT_RULES * environment, *PRIVATE_RULES * private, *OPTION_RULES):
        if rule.refuses(options):
            raise UnsupportedError("; ".join(filter(None, [rule.why, rule.instead])))
