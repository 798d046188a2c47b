"""The leaderboard's tables, for the terminal, Markdown and the site."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from robochoc.experiments.statistics import MeanInterval
from robochoc.experiments.summary import number
from robochoc.leaderboard.certificates import BEST_KNOWN, Certificate, published
from robochoc.leaderboard.instances import FAMILIES, SIZES
from robochoc.leaderboard.peers.claims import wrong_claims_of_peers
from robochoc.leaderboard.results import LeaderboardResults, RunResult, is_peer_name
from robochoc.leaderboard.scores import FamilyScores, Score, family_scores, gap
from robochoc.system.plain_text import listed

HEADINGS = (
    "protocol", "rank", "gap", "area", "best", "proved", "messages", "bytes", "NCCCs", "privacy loss", "CPU s",
)  # fmt: skip
BEST_SIGN = "*"
"""The sign of the best protocols of a family."""


class FamilyTable(NamedTuple):
    """The table of a family.

    Attributes:
        family: The name of the family.
        headings: The headings of the columns that have values.
        lines: A line for each protocol.
        remarks: Sentences about the test and the protocols that refused the family.
    """

    family: str
    headings: list[str]
    lines: list[list[str]]
    remarks: list[str]


def sizes_of(results: LeaderboardResults) -> list[str]:
    """Return the sizes of the instances in the results, in the order of the set."""
    there = {published()[run.instance].size for run in results.runs}
    return [size for size in SIZES if size in there]


def family_tables(results: LeaderboardResults, size: str) -> Iterator[FamilyTable]:
    """Yield the tables of the families in the results, over the instances of a size, in the order of the set."""
    certificates = [published()[run.instance] for run in results.runs]
    there = {one.family for one in certificates if one.size == size}
    for family in (name for name in FAMILIES if name in there):
        scores = family_scores(results, family, size)
        if scores.scores:
            yield _table(family, scores)


def _table(family: str, scores: FamilyScores) -> FamilyTable:
    lines = [_line(one) for one in scores.scores]
    shown = [place for place in range(len(HEADINGS)) if any(line[place] != "-" for line in lines)]
    return FamilyTable(
        family,
        [HEADINGS[place] for place in shown],
        [[line[place] for place in shown] for line in lines],
        list(_remarks(scores)),
    )


def _line(one: Score) -> list[str]:
    return [
        f"{one.protocol}{BEST_SIGN * one.is_best}",
        _interval(one.rank, 1),
        _interval(one.gap, 3),
        "-" if one.area is None else f"{one.area:.3f}",
        f"{one.best}/{one.runs}",
        f"{one.proved}/{one.runs}",
        *(("-" if value is None else number(value)) for value in (one.messages, one.bytes, one.ncccs)),
        "-" if one.privacy is None else f"{one.privacy:.3f}",
        "-" if one.cpu_s is None else f"{one.cpu_s:.2f}",
    ]


def _interval(one: MeanInterval, digits: int) -> str:
    if one.low == one.high:
        return f"{one.mean:.{digits}f}"
    return f"{one.mean:.{digits}f} [{one.low:.{digits}f}, {one.high:.{digits}f}]"


def _remarks(scores: FamilyScores) -> Iterator[str]:
    if scores.p is not None:
        yield f"Friedman's test that all are equal: p = {scores.p:.2g}."
    if scores.refused:
        yield f"Not for this family: {', '.join(scores.refused)}."


def overall(results: LeaderboardResults, size: str) -> tuple[list[str], list[list[str]]]:
    """Return the headings and lines of the table over all families, over the instances of a size.

    The protocols accept different families, so there are no ranks over all families, but numbers of families.
    """
    by_family = {table.family: family_scores(results, table.family, size) for table in family_tables(results, size)}
    lines = []
    for name in [one.name for one in results.entrants]:
        own = [one for scores in by_family.values() for one in scores.scores if one.protocol == name]
        runs = sum(one.runs for one in own)
        if runs:
            gaps = sum(one.gap.mean * one.runs for one in own) / runs
            counts = [sum(one.is_best for one in own), sum(one.best for one in own), sum(one.proved for one in own)]
            lines.append([name, str(len(own)), *(str(count) for count in counts), str(runs), f"{gaps:.3f}"])
    lines.sort(key=lambda line: (-int(line[1]), float(line[-1])))
    return ["protocol", "families", "best in", "best answers", "proofs", "instances", "mean gap"], lines


def peer_remarks(results: LeaderboardResults) -> Iterator[str]:
    """Yield sentences about the peers in the results: what their figures mean, and which of their claims are wrong."""
    peers = [one for one in results.entrants if is_peer_name(one.name)]
    if not peers:
        return
    tools = listed(dict.fromkeys(one.package for one in peers))
    yield (
        f"Peers ({tools}) run as programs of their own. Only the time limit binds them; their messages, bytes and NCCCs"
        " are as they count them, and a dash is a figure that they do not give. Costs are computed by robochoc."
    )
    yield from (f"Wrong claim: {wrong}." for wrong in wrong_claims_of_peers(results.runs))


def holders(runs: Sequence[RunResult]) -> Mapping[str, list[RunResult]]:
    """Return, for each instance, the runs with the best answer in the results."""
    found: dict[str, list[RunResult]] = {}
    gaps: dict[str, float] = {}
    for run in runs:
        own = gap(run, published()[run.instance])
        if own < gaps.get(run.instance, 1.0):
            gaps[run.instance], found[run.instance] = own, []
        if own == gaps.get(run.instance):
            found[run.instance].append(run)
    return found


def answer_text(one: Certificate) -> str:
    """Return the published answer of an instance as text."""
    if one.verdict == BEST_KNOWN:
        return f"best known {one.cost}, bound {one.bound}"
    return one.verdict if one.cost is None else f"{one.verdict} {one.cost}"


def proof_text(one: Certificate) -> str:
    """Return how the published answer of an instance was found and checked, in sentences."""
    if one.verdict == BEST_KNOWN:
        return (
            f"{one.found_by} found the assignment, whose cost robochoc's checker has computed. {one.provers} proved the"
            " bound, which no second solver has confirmed."
        )
    return f"{one.proved_by} proved it, and {one.agreed_by} proved the same."
