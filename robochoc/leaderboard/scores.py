"""Scores of protocols: gaps, areas, ranks with ties, and intervals.

The gap is the primal gap, and the area the primal integral over messages: Berthold, "Measuring the impact of primal
heuristics", Operations Research Letters 41 (2013). The gap of a cost c to the best cost b is 0 if c is not worse, 1 if
their signs differ or there is no answer, and |c - b| / max(|c|, |b|) otherwise. Without costs, the gap of a correct
verdict is 0, and of none 1. The area is the mean gap of the best assignment so far over the budget of messages.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robochoc.experiments.statistics import MeanInterval, holm_corrected, mean_interval, paired_p_value
from robochoc.experiments.task import Status
from robochoc.leaderboard.certificates import Certificate, published
from robochoc.leaderboard.claims import claims_proof
from robochoc.leaderboard.results import Budget, LeaderboardResults, RunResult
from robochoc.system.lazy_dataclass import dataclass

SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Score:
    """The scores of a protocol in a family, on the instances that all its protocols have run.

    Attributes:
        protocol: The protocol.
        rank: The mean rank by the gap, with ties at their mean rank, and its interval.
        is_best: True if the protocol has answers, and the protocol of the lowest rank is not significantly better by
            Wilcoxon's test with Holm's correction.
        best: The number of instances with the best gap 0.
        proved: The number of instances with a proof.
        runs: The number of instances.
        gap: The mean gap, and its interval.
        area: The mean area. None: there are no curves.
        messages: The mean number of messages. None: no run counted them.
        bytes: The mean number of bytes.
        ncccs: The mean number of non-concurrent constraint checks.
        privacy: The mean privacy loss. None: it is not measured, or unknown in some run.
        cpu_s: The mean seconds of processor time. None: times were not recorded.
    """

    protocol: str
    rank: MeanInterval
    is_best: bool
    best: int
    proved: int
    runs: int
    gap: MeanInterval
    area: float | None
    messages: float | None
    bytes: float | None
    ncccs: float | None
    privacy: float | None
    cpu_s: float | None


@dataclass(frozen=True)
class FamilyScores:
    """The scores of a family.

    Attributes:
        scores: The scores by ascending mean rank.
        refused: The protocols that refused all instances.
        p: The p-value of Friedman's test that all protocols are equal. None: there are fewer than three, or too few
            instances.
    """

    scores: tuple[Score, ...]
    refused: tuple[str, ...]
    p: float | None


def gap(run: RunResult, best: Certificate, cost: int | None = None) -> float:
    """Return the gap of a run's answer, or of another `cost`, to the best answer."""
    if best.cost is None:
        return 0.0 if run.verdict == best.verdict else 1.0
    found = run.cost if cost is None else cost
    if found is None:
        return 1.0
    if best.is_reached_by(found):
        return 0.0
    if found * best.cost < 0:
        return 1.0
    return abs(found - best.cost) / max(abs(found), abs(best.cost))


def area(run: RunResult, best: Certificate, budget: Budget) -> float | None:
    """Return the mean gap of the best assignment so far over the budget of messages; None if it is not known.

    It is not known for problems that change, and for peers, which report no curve.
    """
    if best.scenario or run.is_by_peer:
        return None
    end = budget.messages
    if best.cost is None:
        sent = run.messages or 0
        return min(sent, end) / end if gap(run, best) == 0 else 1.0
    total, since, current = 0.0, 0, 1.0
    for messages, cost in run.curve:
        until = min(messages, end)
        total += current * (until - since)
        since, current = until, gap(run, best, cost)
    return (total + current * (end - since)) / end


def family_scores(results: LeaderboardResults, family: str, size: str) -> FamilyScores:
    """Return the scores of a family, over its instances of a size in the results.

    A protocol that refuses all instances of the family has no score; one that refuses some has the gap 1 on these.
    """
    certificates = published()
    runs: dict[str, dict[str, RunResult]] = {}
    for run in results.runs:
        one = certificates[run.instance]
        if (one.family, one.size) == (family, size):
            runs.setdefault(run.protocol, {})[run.instance] = run
    refused = [name for name, own in runs.items() if all(run.status == Status.REFUSED for run in own.values())]
    entered = {name: own for name, own in runs.items() if name not in refused}
    common = [one for one in certificates if entered and all(one in own for own in entered.values())]
    if not common:
        return FamilyScores((), tuple(refused), None)
    gaps = {name: [gap(own[one], certificates[one]) for one in common] for name, own in entered.items()}
    ranks = ranks_of(gaps)
    best = _best(gaps, ranks)
    scores = [
        _score(name, [own[one] for one in common], ranks[name], gaps[name], results.budget, is_best=name in best)
        for name, own in entered.items()
    ]
    ordered = sorted(scores, key=lambda one: (one.rank.mean, one.protocol))
    return FamilyScores(tuple(ordered), tuple(refused), _friedman(gaps))


def ranks_of(gaps: Mapping[str, Sequence[float]]) -> dict[str, list[float]]:
    """Return the rank of each protocol on each instance: 1 is the lowest gap, and equal gaps share their mean rank."""
    from scipy.stats import rankdata  # noqa: PLC0415 - an extra

    table = rankdata([list(own) for own in gaps.values()], method="average", axis=0)
    return {name: [float(rank) for rank in row] for name, row in zip(gaps, table, strict=True)}


def _best(gaps: Mapping[str, Sequence[float]], ranks: Mapping[str, Sequence[float]]) -> set[str]:
    """Return the protocol of the lowest mean rank, and all protocols that are not significantly worse."""
    first = min(gaps, key=lambda name: (sum(ranks[name]), name))
    others = [name for name in gaps if name != first]
    p = [paired_p_value([b - a for a, b in zip(gaps[first], gaps[name], strict=True)]) for name in others]
    corrected = holm_corrected(p)
    equal = {first, *(name for name, one in zip(others, corrected, strict=True) if one is None or one > SIGNIFICANT)}
    return {name for name in equal if min(gaps[name]) < 1}


def _friedman(gaps: Mapping[str, Sequence[float]]) -> float | None:
    """Return the p-value of Friedman's test, whose statistic is corrected for ties."""
    columns = [list(own) for own in gaps.values()]
    if len(columns) < 3 or len(columns[0]) < 2 or all(len({*row}) == 1 for row in zip(*columns, strict=True)):  # noqa: PLR2004
        return None
    from scipy.stats import friedmanchisquare  # noqa: PLC0415 - an extra

    return float(friedmanchisquare(*columns).pvalue)


def _score(
    name: str,
    runs: Sequence[RunResult],
    ranks: Sequence[float],
    gaps: Sequence[float],
    budget: Budget,
    *,
    is_best: bool,
) -> Score:
    certificates = published()
    areas = [area(run, certificates[run.instance], budget) for run in runs]
    return Score(
        protocol=name,
        rank=mean_interval(ranks),
        is_best=is_best,
        best=sum(one == 0 for one in gaps),
        proved=sum(map(claims_proof, runs)),
        runs=len(runs),
        gap=mean_interval(gaps),
        area=_mean(areas),
        messages=_mean_of_counted(runs, "messages"),
        bytes=_mean_of_counted(runs, "bytes"),
        ncccs=_mean_of_counted(runs, "ncccs"),
        privacy=_mean([run.privacy for run in runs]),
        cpu_s=_mean([run.cpu_s for run in runs]),
    )


def _mean_of_counted(runs: Sequence[RunResult], name: str) -> float | None:
    """Return the mean of a count over the runs that have it; refused runs have no counts.

    Peers may count only some runs, such as those that end: then the mean is not known.
    """
    return _mean([count for run in runs if (count := getattr(run, name)) is not None or _is_uncounted(run)])


def _is_uncounted(run: RunResult) -> bool:
    return run.is_by_peer and run.status != Status.REFUSED


def _mean(values: Sequence[float | None]) -> float | None:
    """Return the mean; None if there are no values, or one of them is unknown."""
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known and len(known) == len(values) else None
