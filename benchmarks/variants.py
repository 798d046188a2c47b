"""Part `variants`: one thing changed at a time, to see what the differences between protocols come from."""

from __future__ import annotations

import heapq
import os
import statistics
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from colouring import colouring
from measure import FailedError, say
from report import Row, Section
from rows import append_row, read_rows
from sweep import LIMIT, LIMIT_SLOW, solved

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.generators.random_csp import random_csp
from robochoc.model.message import Envelope, Value
from robochoc.model.orders import Order, with_order
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.abt import ABT, Nogood
from robochoc.protocols.abt_do import ABTDORetro
from robochoc.protocols.afc import AFC
from robochoc.protocols.afc_ng import AFCng
from robochoc.protocols.afc_tree import AFCTree
from robochoc.protocols.agile_abt import AgileABT
from robochoc.protocols.awc import AWC
from robochoc.protocols.backtracking import Backtracking
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.solver.compiled import LocalProblem

DATA = Path(__file__).with_name("data") / "variants.csv"
READING = Path(__file__).with_name("variants.md")
PROBLEMS = 15


class OneByOne(Concurrent):
    """A robot reads one message at a time, and settles after each."""

    def get(self) -> Sequence[Envelope]:
        """The first message of the packet; the others go back."""
        packet = super().get()
        for place, message in enumerate(packet[1:]):
            heapq.heappush(self._inboxes[message.receiver], (message.clock, place - len(packet), message))
        return packet[:1]


class AFCngToAll(AFCng):
    """As in the paper: a CPA goes to all lower robots."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.told = list(order.names[self._rank + 1 :])


class AFCTreeToAll(AFCTree):
    """As in the paper: a CPA goes to all robots below in the tree."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.told = list(self._below(problem.agent))

    def _below(self, name: str) -> Iterator[str]:
        for child in self._tree.children[name]:
            yield child
            yield from self._below(child)


def _first_of_all(robot: Backtracking, view: Mapping[str, Value]) -> int | None:
    """The first value that is left, once all have been looked at."""
    values = range(len(robot.problem.values))
    return min((index for index in values if robot._consistent(index, view)), default=None)  # noqa: SLF001


class ABTAll(ABT):
    """Looks at all values before it takes the first that is left."""

    def _choose_value(self, view: Mapping[str, Value]) -> int | None:
        return _first_of_all(self, view)


class ABTWholeView(ABT):
    """As in the first papers (Yokoo et al. 1992): a nogood is all that is known, not only what does harm."""

    def _backtrack(self) -> None:
        if not self.store.resolve():
            self.conclude(Verdict.NO_SOLUTION)
            return
        lhs = dict(self.view)
        culprit = self.order.lowest(lhs)
        value = lhs.pop(culprit)
        self.send(culprit, Nogood(lhs, value))
        self._update(culprit, None)


class RetroAll(ABTDORetro):
    """Looks at all values before it takes the first that is left, so what it says is left is left."""

    def _choose_value(self, view: Mapping[str, Value]) -> int | None:
        return _first_of_all(self, view)


class AgileAll(AgileABT):
    """Looks at all values before it takes the first that is left, so what it says is left is left."""

    def _choose_value(self, view: Mapping[str, Value]) -> int | None:
        return _first_of_all(self, view)


SLOW = (AWC, ABTWholeView)
"""These get the lower limit on messages."""


class Variant(NamedTuple):
    """A protocol, under an order and a schedule."""

    label: str
    protocol: type[Protocol]
    order: Order = Order.MAX_DEGREE
    schedule: type[Concurrent] = Concurrent


LEX, DFS = Order.LEXICOGRAPHIC, Order.DFS
ORDERED = (
    Variant("abt", ABT),
    Variant("abt, lexicographic", ABT, LEX),
    Variant("abt, one by one", ABT, schedule=OneByOne),
    Variant("abt, all values", ABTAll),
    Variant("abt-do-retro", ABTDORetro),
    Variant("abt-do-retro, lexicographic", ABTDORetro, LEX),
    Variant("abt-do-retro, one by one", ABTDORetro, schedule=OneByOne),
    Variant("abt-do-retro, all values", RetroAll),
    Variant("agile-abt", AgileABT),
    Variant("agile-abt, lexicographic", AgileABT, LEX),
    Variant("agile-abt, one by one", AgileABT, schedule=OneByOne),
    Variant("agile-abt, all values", AgileAll),
)
FORWARD = (
    Variant("afc", AFC),
    Variant("afc, one by one", AFC, schedule=OneByOne),
    Variant("afc-ng", AFCng),
    Variant("afc-ng, lexicographic", AFCng, LEX),
    Variant("afc-ng, one by one", AFCng, schedule=OneByOne),
    Variant("afc-ng, CPAs to all", AFCngToAll),
    Variant("afc-ng, dfs", AFCng, DFS),
    Variant("afc-tree", AFCTree),
    Variant("afc-tree, dfs", AFCTree, DFS),
    Variant("afc-tree, one by one", AFCTree, schedule=OneByOne),
    Variant("afc-tree, CPAs to all", AFCTreeToAll),
)
BRANCHES = (
    Variant("abt", ABT),
    Variant("afc-ng", AFCng),
    Variant("afc-ng, CPAs to all", AFCngToAll),
    Variant("afc-ng, dfs", AFCng, DFS),
    Variant("afc-tree", AFCTree),
    Variant("afc-tree, CPAs to all", AFCTreeToAll),
    Variant("afc-tree, dfs", AFCTree, DFS),
)
COMMITMENT = (
    Variant("abt", ABT),
    Variant("abt, lexicographic", ABT, LEX),
    Variant("abt, random order", ABT, Order.RANDOM),
    Variant("abt, random order, whole view", ABTWholeView, Order.RANDOM),
    Variant("awc", AWC),
    Variant("awc, one by one", AWC, schedule=OneByOne),
)


class Study(NamedTuple):
    """Some problems, and the variants that are to solve them."""

    name: str
    teams: Sequence[Team]
    variants: Sequence[Variant]


class Figure(NamedTuple):
    """What one variant needs for all problems of a study."""

    study: str
    label: str
    problems: int
    soluble: int
    censored: int
    messages_median: float
    messages_mean: float
    bytes_mean: float
    ncccs_median: float
    ncccs_mean: float
    checks_mean: float


def measured() -> Section:
    """All studies."""
    figures = list(_figures())
    names = dict.fromkeys(figure.study for figure in figures)
    tables = tuple(_table(name, [figure for figure in figures if figure.study == name]) for name in names)
    return Section("variants", "What makes the difference between protocols", READING.read_text().strip(), tables)


def _figures() -> Iterator[Figure]:
    """One for each variant of each study; with ROBOCHOC_BENCH_RESUME set, those that are there are not repeated."""
    DATA.parent.mkdir(exist_ok=True)
    if not os.environ.get("ROBOCHOC_BENCH_RESUME"):
        DATA.unlink(missing_ok=True)
    done = {(figure.study, figure.label): figure for figure in read_rows(DATA, Figure)}
    for study in studies():
        truth: dict[int, str] = {}
        for variant in study.variants:
            figure = done.get((study.name, variant.label))
            if figure is None:
                figure = _studied(study, variant, truth)
                append_row(DATA, figure)
            yield figure


def studies() -> Iterator[Study]:
    """Sparse and dense problems at the peak; problems with many solutions; graphs that are nearly trees; colourings."""

    def drawn(agents: int, domain: int, density: float, tightness: float) -> list[Team]:
        return [random_csp(agents, domain, density, tightness, seed, connected=True) for seed in range(PROBLEMS)]

    yield Study("sparse: <20, 10, 0.2, 0.65>", drawn(20, 10, 0.2, 0.65), (*ORDERED, *FORWARD))
    yield Study("dense: <15, 5, 0.7, 0.28>", drawn(15, 5, 0.7, 0.28), (*ORDERED, *FORWARD))
    yield Study("nearly a tree: <20, 10, 0.13, 0.8>", drawn(20, 10, 0.13, 0.8), BRANCHES)
    yield Study("sparse and soluble: <20, 10, 0.2, 0.55>", drawn(20, 10, 0.2, 0.55), COMMITMENT)
    yield Study("3-colouring, 20 robots, 40 edges", [colouring(seed) for seed in range(PROBLEMS)], COMMITMENT)
    yield Study("3-colouring, 60 robots, 120 edges", [colouring(seed, 60, 120) for seed in range(PROBLEMS)], COMMITMENT)
    yield Study("3-colouring, 30 robots, 81 edges", [colouring(seed, 30, 81) for seed in range(PROBLEMS)], COMMITMENT)


def _studied(study: Study, variant: Variant, truth: dict[int, str]) -> Figure:
    """Let `variant` solve all problems of `study`. Verdicts must be those in `truth`, which learns new ones."""
    say(f"{study.name}: {variant.label}")
    limit = LIMIT_SLOW if variant.protocol in SLOW else LIMIT
    runs = [
        solved(with_order(team, variant.order, seed), variant.protocol, variant.schedule(seed), limit)
        for seed, team in enumerate(study.teams)
    ]
    verdicts = [run[0] for run in runs]
    for seed, verdict in enumerate(verdicts):
        if verdict != Verdict.UNKNOWN and truth.setdefault(seed, verdict) != verdict:
            raise FailedError(f"{variant.label} says {verdict} on {study.name}, problem {seed}")
    _, messages, content, ncccs, checks = zip(*runs, strict=True)
    return Figure(
        study.name,
        variant.label,
        len(runs),
        verdicts.count(Verdict.SOLUTION),
        verdicts.count(Verdict.UNKNOWN),
        statistics.median(messages),
        round(statistics.mean(messages), 1),
        round(statistics.mean(content), 1),
        statistics.median(ncccs),
        round(statistics.mean(ncccs), 1),
        round(statistics.mean(checks), 1),
    )


def _table(name: str, figures: Sequence[Figure]) -> list[Row]:
    soluble = max(figure.soluble for figure in figures)
    what = ("broken off", "messages: median (mean)", "NCCCs: median (mean)", "bytes, mean", "checks, mean")
    head = (f"{name} ({soluble} of {figures[0].problems} soluble)", *what)
    return [head, *map(_row, figures)]


def _row(figure: Figure) -> Row:
    half = ">= " * (figure.censored >= figure.problems / 2)
    some = ">= " * bool(figure.censored)
    return (
        figure.label,
        str(figure.censored),
        f"{half}{figure.messages_median:,.0f} ({some}{figure.messages_mean:,.0f})",
        f"{half}{figure.ncccs_median:,.0f} ({some}{figure.ncccs_mean:,.0f})",
        f"{some}{figure.bytes_mean:,.0f}",
        f"{some}{figure.checks_mean:,.0f}",
    )
