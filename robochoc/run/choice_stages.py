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

from robochoc.run.facts import Facts
from robochoc.run.options import AnswerRule, Options, Runtime, Stage
from robochoc.run.registry import protocol_named

FIRST = 0.1
"""The end of the first complete search, as a fraction of the time until the deadline."""
FIRST_ON_TREES = 0.5
"""The same for a protocol with tables on a pseudo-tree: it ends soon, or has no assignment."""
MAXSUM_UNTIL, DSA_UNTIL, MGM2_UNTIL = 0.3, 0.6, 0.75
"""The ends of the local searches."""
KEPT = 0.9
"""The probability that a robot keeps its value of the best assignment when a local search is restarted."""
RENEWED = 2
"""The mean number of robots with new values in a small team, in which `KEPT` would renew fewer."""
CYCLES = 30
"""The number of cycles of a local search until it is restarted."""
MAXSUM_CYCLES = 1000


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
    return replace(options, stages=stages, chosen={**options.chosen, "stages": WHY})


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
    )


def _stages(options: Options, facts: Facts) -> list[Stage]:
    name = options.protocol
    traits = protocol_named(name).traits
    kept = min(KEPT, 1 - RENEWED / max(facts.robots, RENEWED))
    cycles = {"cycles": str(CYCLES)}
    local = [
        Stage("maxsum", MAXSUM_UNTIL, {"cycles": str(MAXSUM_CYCLES)}),
        Stage("dsa", DSA_UNTIL, cycles, kept),
        Stage("mgm2", MGM2_UNTIL, cycles, kept),
    ]
    if not traits.complete:
        return [*local[:-1], local[-1]._replace(until=1.0)]
    if traits.wide_tables:
        left = 1 - FIRST_ON_TREES
        later = [one._replace(until=FIRST_ON_TREES + left * one.until / MGM2_UNTIL) for one in local]
        return [Stage(name, FIRST_ON_TREES, options.settings), *later]
    return [Stage(name, FIRST, options.settings), *local, Stage(name, 1.0, options.settings)]
