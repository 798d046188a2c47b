"""The stages of a run with a deadline for which `auto` chooses the protocols. No other module divides the time.

1. A complete search for a short time decides easy problems, and often finds a first solution.
2. Local searches improve the best assignment: Max-Sum finds good assignments of problems with few hard constraints; DSA
   and MGM-2 are restarted from the best assignment, in which a few robots choose new values.
3. The complete search looks for cheaper assignments than the best one, and proves a bound.

The study behind the times: `python benchmarks/run.py deadline`, docs/guides/which-protocol.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType

from robochoc.run.facts import Facts
from robochoc.run.options import AnswerRule, Options, Runtime, Stage
from robochoc.run.registry import protocol_named

FIRST = 0.1
"""The end of the first complete search, as a fraction of the time until the deadline."""
FIRST_ON_TREES = 0.5
"""The same for a protocol with tables on a pseudo-tree: it ends soon, or has no assignment."""
CROWDED = 0.6
"""The share of linked pairs of robots from which hard constraints are those of a crowd, such as different values for
all: Max-Sum then finds no assignment, and MGM-2 the best ones."""
LARGE_S = 400
"""The robots and links for each second until the deadline from which the set-up of further searches takes too long."""
CROWD, EQUAL, FORBIDDING, OTHER = "crowd", "equal", "forbidding", "other"
"""The kinds of teams: see `CROWDED`; all costs are equal; constraints forbid something; none of these."""
LOCAL_SEARCHES = MappingProxyType(
    {
        CROWD: (("dsa", 0.3), ("mgm2", 0.8)),
        EQUAL: (("maxsum-ad", 0.35), ("dsa", 0.85)),
        FORBIDDING: (("maxsum", 0.25), ("maxsum-ad", 0.65), ("dsa", 0.75), ("mgm2", 0.85)),
        OTHER: (("maxsum", 0.3), ("maxsum-ad", 0.5), ("dsa", 0.65), ("mgm2", 0.8)),
    }
)
"""The local searches and their ends, by the kind of the team."""
LOCAL_SEARCHES_IF_LARGE = MappingProxyType(
    {
        CROWD: (("dsa", 0.3), ("mgm2", 1.0)),
        EQUAL: (("maxsum-ad", 0.35), ("dsa", 1.0)),
        FORBIDDING: (("maxsum-ad", 0.7), ("dsa", 1.0)),
        OTHER: (("maxsum-ad", 0.5), ("dsa", 1.0)),
    }
)
"""The same for teams that are large for the deadline (`LARGE_S`), in which only local searches are used."""
PROCESSES_S = 6
"""The same if each robot is a process: the number of robots for each second. Then there is only one search."""
FIRST_IN_PROCESSES, DSA_IN_PROCESSES_UNTIL = 0.25, 0.6
"""The ends of the first complete search and of DSA in processes."""
MANY_CYCLES = 1_000_000
"""The number of cycles of a search that ends only with its stage."""
CYCLES, KEPT = 30, 0.9
"""The number of cycles of DSA and MGM-2 until they are restarted, and the probability that a robot then keeps its value
of the best assignment."""
CYCLES_IF_EQUAL, KEPT_IF_EQUAL = 100, 0.95
"""The same for DSA if all costs are equal: its robots then also leave assignments without a better one nearby."""
RENEWED = 2
"""The mean number of robots with new values in a small team, in which `KEPT` would renew fewer."""
MAXSUM_CYCLES = 1000

ONLY_LOCAL = "the team is large for the deadline: only local searches give an answer in time"
WHY = "several protocols search in turn until the deadline, each from the best assignment so far"


def with_stages(options: Options, facts: Facts, accepts: Callable[[str, Options], bool]) -> Options:
    """Return `options`, in which a protocol was chosen, with the stages of a run with a deadline, if they help.

    Args:
        options: How to run, with the chosen protocol.
        facts: The facts about the team.
        accepts: Returns whether a protocol accepts the team and the options.
    """
    if not _applies(options, facts):
        return options
    others = replace(options, settings={})
    stages = tuple(
        one for one in _stages(options, facts) if one.protocol == options.protocol or accepts(one.protocol, others)
    )
    if all(one.protocol == options.protocol for one in stages):
        return options
    if options.protocol in {one.protocol for one in stages}:
        return replace(options, stages=stages, chosen={**options.chosen, "stages": WHY})
    last = stages[-1].protocol
    return replace(options, protocol=last, stages=stages, chosen={"protocol": ONLY_LOCAL, "stages": WHY})


def _applies(options: Options, facts: Facts) -> bool:
    """Return whether the run may consist of stages."""
    limits = (options.messages, options.ncccs, options.cycles, options.preprocess, options.on_loss)
    others = options.count or options.spares or options.kill or facts.loss or options.cluster
    return (
        options.deadline is not None
        and facts.has_costs
        and not (facts.changes or facts.partially_known or others)
        and limits == (None,) * len(limits)
        and options.answer == AnswerRule.BEST
        and options.runtime != Runtime.NETWORK
        and not options.settings  # they are of the chosen protocol
    )


def _stages(options: Options, facts: Facts) -> list[Stage]:
    name, traits = options.protocol, protocol_named(options.protocol).traits
    if options.runtime == Runtime.PROCESSES:
        return _stages_in_processes(options, facts)
    large = facts.robots + facts.links > LARGE_S * (options.deadline or 0.0)
    searches = (LOCAL_SEARCHES_IF_LARGE if large else LOCAL_SEARCHES)[_kind(facts)]
    local = [_local_search(one, until, facts) for one, until in searches]
    if large or not traits.complete:
        return _within(local, 0.0, 1.0)
    if traits.wide_tables:
        return [Stage(name, FIRST_ON_TREES, options.settings), *_within(local, FIRST_ON_TREES, 1.0)]
    return [Stage(name, FIRST, options.settings), *local, Stage(name, 1.0, options.settings)]


def _kind(facts: Facts) -> str:
    """Return the kind of the team."""
    if facts.forbids:
        return CROWD if facts.share_linked >= CROWDED else FORBIDDING
    return EQUAL if facts.has_equal_costs else OTHER


def _stages_in_processes(options: Options, facts: Facts) -> list[Stage]:
    """Return the stages if each robot is a process: few, because the processes of each stage have to start."""
    name, traits = options.protocol, protocol_named(options.protocol).traits
    if facts.robots > PROCESSES_S * (options.deadline or 0.0) or not traits.complete:
        return [Stage("dsa", 1.0, {"cycles": str(MANY_CYCLES)})]
    first = Stage(name, FIRST_ON_TREES if traits.wide_tables else FIRST_IN_PROCESSES, options.settings)
    local = Stage("dsa", DSA_IN_PROCESSES_UNTIL, {"cycles": str(MANY_CYCLES)})
    if traits.wide_tables:
        return [first, local._replace(until=1.0)]
    return [first, local, Stage(name, 1.0, options.settings)]


def _local_search(name: str, until: float, facts: Facts) -> Stage:
    if name.startswith("maxsum"):
        return Stage(name, until, {"cycles": str(MAXSUM_CYCLES)})
    is_longer = name == "dsa" and facts.has_equal_costs
    cycles, kept = (CYCLES_IF_EQUAL, KEPT_IF_EQUAL) if is_longer else (CYCLES, KEPT)
    return Stage(name, until, {"cycles": str(cycles)}, min(kept, 1 - RENEWED / max(facts.robots, RENEWED)))


def _within(stages: list[Stage], begin: float, end: float) -> list[Stage]:
    """Return `stages` with the same proportions, the last of which ends at `end`."""
    last = stages[-1].until
    return [one._replace(until=begin + (end - begin) * one.until / last) for one in stages]
