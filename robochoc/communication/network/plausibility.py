"""Plausibility of robots' reports: finds a robot that lies, or two of which one lies. Pure.

The master has seen no file. It knows what robots have declared (profiles), what each protocol's robots may conclude
(traits), and that whatever one robot says it has sent another, that one has had, or will not have had. So a lie is held
against the liar's earlier words, or against a neighbour's. `docs/guides/security.md` says what that leaves.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from types import MappingProxyType
from typing import NamedTuple

from robochoc.communication.control import Snapshot
from robochoc.communication.network.control_messages import Charge, CheckResult, DetailedReport, Exchanged
from robochoc.communication.network.framing import LARGEST_FRAME
from robochoc.communication.network.profile import LONGEST_NAME, MOST_VARIABLES
from robochoc.communication.quiescence import Counts
from robochoc.formats.diagnostics import shortened
from robochoc.formats.names import is_name
from robochoc.model.outcome import CheckCounts
from robochoc.model.problem import INFINITE, Domain
from robochoc.protocols.findings import Findings
from robochoc.protocols.traits import Traits

LARGEST_COUNT = 2**53
CHECKS_PER_S = 10**12
"""More constraint checks a second than any robot can do, even with tables that were made before."""
LARGEST_MEMORY = 2**50
MOST_KINDS = 100
"""Of messages: a protocol has fewer."""
MOST_CHARGES = 10_000
NOTICEABLE = 100
"""A gap of fewer messages may be under way when the time is over."""
_ROUNDED = 1 + 2**-40
"""Costs may be larger than floats are exact, and some travel as floats."""
HEXADECIMAL = re.compile(r"[0-9a-f]+")
_NOBODY = Exchanged(0, 0, 0)


class Doubt(NamedTuple):
    """A contradiction between the reports of two robots, in words. One of `between` has not told the truth."""

    between: tuple[str, str]
    why: str


@dataclass(frozen=True)
class Declarations:
    """The master's knowledge before a search: the robots' ways to end it, and their profiles' declarations.

    `shown` are the robots' variables with their domains, `dearest` is the most that each one's constraints charge
    together.
    """

    traits: Traits = field(default_factory=Traits)
    shown: Mapping[str, Mapping[str, Domain]] = field(default_factory=lambda: MappingProxyType({}))
    dearest: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))


NOTHING_DECLARED = Declarations()


class FinishedSearch(NamedTuple):
    """The master's knowledge of a finished search.

    `order` names its robots, `counts` holds the last counters of one of them, `duration_s` is how many seconds it
    took, `by_quiescence` whether it ended by quiescence, `lossy` whether robots were to drop messages.
    """

    order: Collection[str]
    counts: Counts
    duration_s: float
    by_quiescence: bool
    lossy: bool = False


# Reports of one robot


def fault_of_counters(counts: Counts, before: Counts | None) -> str:
    """Return why a robot that reported `before` cannot have counted `counts`. Empty if it can."""
    if min(counts) < 0 or max(counts) > LARGEST_COUNT:
        return f"it has counted {counts.sent:,} messages sent and {counts.received:,} taken in, which cannot be"
    if before is not None and (counts.sent < before.sent or counts.received < before.received):
        return (
            f"its counters have fallen, from {before.sent:,} messages sent and {before.received:,} taken in"
            f" to {counts.sent:,} and {counts.received:,}"
        )
    return ""


def fault_of_account(name: str, account: DetailedReport, declared: Declarations, course: FinishedSearch) -> str:
    """Return why the robot `name` cannot report `account`; empty if it can."""
    return (
        next(_faults_of_values(name, account.assignment, declared, assigned=account.assigned), "")
        or _fault_of_metrics(account, course.duration_s)
        or _fault_of_drops(account, course)
        or _fault_of_exchange(name, account, course)
        or fault_of_findings(account.findings, course.order)
    )


def fault_of_snapshot(name: str, snapshot: Snapshot, declared: Declarations, order: Collection[str]) -> str:
    """Return why the robot `name` cannot have what it says in `snapshot`; empty if it can."""
    if not 0 <= snapshot.lost <= LARGEST_COUNT:
        return "it has reported counts that cannot be"
    return next(_faults_of_values(name, snapshot.assignment, declared), "") or fault_of_findings(
        snapshot.findings, order
    )


def _faults_of_values(
    name: str, values: Mapping[str, int], declared: Declarations, *, assigned: bool = True
) -> Iterator[str]:
    own = declared.shown.get(name, {})
    if values and not assigned:
        yield "it has reported values, and that it has none"
    if len(values) > MOST_VARIABLES:
        yield f"it has reported more than {MOST_VARIABLES:,} variables"
    if values and not all(values.get(variable) in domain for variable, domain in own.items()):
        yield "it has reported values that it cannot have"
    for variable in values.keys() - own.keys():
        if not is_name(variable) or len(variable) > LONGEST_NAME:
            yield "it has reported a variable whose name is none"
        other = next((robot for robot, theirs in declared.shown.items() if variable in theirs), None)
        if other is not None:
            yield f"it has reported a value of {variable}, which is {other}'s"


def _fault_of_exchange(name: str, account: DetailedReport, course: FinishedSearch) -> str:
    exchanged = account.exchanged
    if name in exchanged or not exchanged.keys() <= set(course.order):
        return "it has reported messages with somebody who is not of the team"
    if any(not 0 <= count <= LARGEST_COUNT for one in exchanged.values() for count in one):
        return "it has reported counts that cannot be"
    if sum(account.metrics.messages.values()) != sum(one.sent for one in exchanged.values()):
        return "the messages that it says it has sent are not as many as those that it says it has sent to others"
    total = total_of(account)
    if fault := fault_of_counters(total, course.counts):
        return fault
    if course.by_quiescence and total.sent > course.counts.sent and total.received == course.counts.received:
        return "it has sent messages after all were quiet, in answer to none"
    return ""


def total_of(account: DetailedReport) -> Counts:
    """Return all messages that a robot says it has sent and taken in."""
    exchanged = account.exchanged.values()
    return Counts(sum(one.sent for one in exchanged), sum(one.received for one in exchanged))


def _fault_of_metrics(account: DetailedReport, duration_s: float) -> str:
    spent = account.metrics
    if len(spent.messages) > MOST_KINDS or not all(
        is_name(kind) and len(kind) <= LONGEST_NAME for kind in spent.messages
    ):
        return "it has reported messages of kinds that are none"
    counts = (*spent.messages.values(), spent.bytes, spent.largest, spent.ncccs, spent.checks, spent.memory)
    if any(not 0 <= count <= LARGEST_COUNT for count in counts):
        return "it has reported counts that cannot be"
    sent = sum(spent.messages.values())
    if not (sent <= spent.bytes <= sent * LARGEST_FRAME and spent.largest <= spent.bytes <= sent * spent.largest):
        many = f"{sent:,} messages of {spent.bytes:,} bytes together, the largest of {spent.largest:,}"
        return f"it has reported {many}, which cannot be"
    if spent.checks > CHECKS_PER_S * (duration_s + 1):
        return f"it has reported {spent.checks:,} constraint checks in {duration_s:.1f} s, which cannot be"
    heard = max((one.clock for one in account.exchanged.values()), default=0)
    if spent.ncccs > heard + spent.checks:
        return (
            f"its clock is at {spent.ncccs:,}, and neither its own {spent.checks:,} checks nor others' bring it there"
        )
    others = (spent.wall_s, spent.compile_s, spent.simulated_s)
    return "it has reported costs that are not its own" if any(others) or spent.memory > LARGEST_MEMORY else ""


def _fault_of_drops(account: DetailedReport, course: FinishedSearch) -> str:
    most = total_of(account).received if course.lossy else 0
    return "" if 0 <= account.metrics.lost_messages <= most else "it has dropped more than it was to"


def fault_of_findings(findings: Findings, order: Collection[str]) -> str:
    """Return why no robot in `order` can know `findings` of the whole. Empty if one can."""
    names: list[str] = []
    if findings.place is not None:
        names += [*filter(None, [findings.place.parent]), *findings.place.pseudo_parents]
    if findings.best is not None:
        names += findings.best.values
    if not set(names) <= set(order):
        return "it tells of a robot that is not of the team"
    costs = (findings.bound or 0, findings.best.cost if findings.best is not None else 0)
    if not all(0 <= cost <= INFINITE for cost in costs):
        return "it tells of costs that cannot be"
    if findings.count is not None and not HEXADECIMAL.fullmatch(findings.count):
        return "it tells of a number that is none"
    if findings.listing is not None and min(findings.listing.places, default=0) < 0:
        return "it tells of optima that cannot be"
    entries = findings.trail.entries if findings.trail is not None else []
    return "it tells of cycles that cannot be" if any(place < 0 for place in chain.from_iterable(entries)) else ""


def fault_of_check(name: str, check: CheckResult, declared: Declarations, order: Collection[str]) -> str:
    """Return why the robot `name` cannot have checked its constraints so; empty if it can."""
    judged = (*check.shared, *check.copies)
    if not 0 <= check.cost <= declared.dearest.get(name, LARGEST_COUNT) * _ROUNDED < INFINITE:
        return "its constraints charge more than it has declared"
    if not (
        len(judged) <= MOST_CHARGES and 0 <= sum(one.constraints for one in check.shared) <= check.held <= LARGEST_COUNT
    ):
        return "it has checked constraints in a number that cannot be"
    if any(one.constraints < 1 or not one.price >= 0 or not all(map(is_name, one.variables)) for one in judged):
        return "it has checked constraints that cannot be"
    if any(one.holder != name for one in check.shared) or any(
        one.holder == name or one.holder not in order for one in check.copies
    ):
        return "it has checked constraints in another's name"
    if check.allowed and sum(one.price for one in check.shared) > check.cost * _ROUNDED:
        return "it has said what its constraints charge, and that together they charge less"
    return ""


# Reports of two robots


def doubts_about_messages(accounts: Mapping[str, DetailedReport], *, quiet: bool) -> Iterator[Doubt]:
    """Yield what two robots say of the messages between them that cannot both be so.

    Nobody speaks after its account, so a message that was taken in was sent; and where all were `quiet`, and nobody has
    stirred since, each that was sent was taken in.
    """
    for name, account in accounts.items():
        for other, mine in account.exchanged.items():
            theirs = accounts[other].exchanged.get(name, _NOBODY) if other in accounts else None
            if theirs is None:
                continue
            # Each pair is met twice if both have something to say of it, and once if one says that there was nothing.
            sent, had = mine.sent, theirs.received
            if had > sent or (quiet and had < sent):
                yield Doubt((name, other), _gap(name, sent, other, had))
            if name not in accounts[other].exchanged and mine.received:
                yield Doubt((other, name), _gap(other, 0, name, mine.received))
            if mine.clock > accounts[other].metrics.ncccs:
                why = f"{name} says that the clock of {other} was at {mine.clock:,} when it spoke, and {other} that it"
                yield Doubt((other, name), f"{why} came to {accounts[other].metrics.ncccs:,}")


def widest_gap(accounts: Mapping[str, DetailedReport]) -> str:
    """Return, in words, between which two robots by far too many messages are under way; empty if there are none."""
    widest, found = 0, ""
    for name, account in accounts.items():
        for other, mine in account.exchanged.items():
            if other in accounts:
                had = accounts[other].exchanged.get(name, _NOBODY).received
                if mine.sent - had > max(widest, NOTICEABLE, had):
                    widest, found = mine.sent - had, _gap(name, mine.sent, other, had)
    return found


def _gap(name: str, sent: int, other: str, had: int) -> str:
    return f"{name} says that it has sent {other} {sent:,} messages, and {other} that it has had {had:,} of it"


def doubts_about_values(assignments: Mapping[str, Mapping[str, int]]) -> Iterator[Doubt]:
    """Yield which variables two robots call their own."""
    owners: dict[str, str] = {}
    for name, assignment in assignments.items():
        for variable in assignment:
            other = owners.setdefault(variable, name)
            if other != name:
                yield Doubt((other, name), f"the variable {variable} is {other}'s, and {name}'s too")


def thoroughness(checks: Mapping[str, CheckResult]) -> CheckCounts:
    """Return how many constraints others than those who hold them have checked too, and how many nobody else has.

    Where two say that they are differently many over the same variables, those count that both say there are.
    """
    held = sum(check.held for check in checks.values())
    seconded: dict[tuple[str, tuple[str, ...]], int] = {}
    for one in (one for check in checks.values() for one in check.copies):
        seconded[_key(one)] = max(one.constraints, seconded.get(_key(one), 0))
    both = sum(min(one.constraints, seconded.get(_key(one), 0)) for check in checks.values() for one in check.shared)
    return CheckCounts(both, held - both)


def doubts_about_checks(checks: Mapping[str, CheckResult]) -> Iterator[Doubt]:
    """Yield which constraints charge one thing by who holds them, and another by a robot that knows them as well."""
    prices = {_key(one): one.price for check in checks.values() for one in check.shared}
    for name, check in checks.items():
        for one in check.copies:
            charged = prices.get(_key(one))
            alike = charged is not None and math.isclose(charged, one.price, rel_tol=_ROUNDED - 1)
            if not alike and one.holder in checks:
                what = f"the constraint over {shortened(' '.join(one.variables))}"
                says = "has no such constraint" if charged is None else f"says that it {_charges(charged)}"
                why = f"{name} says that {what} {_charges(one.price)}, and {one.holder}, which holds it, {says}"
                yield Doubt((one.holder, name), why)


def objections(checks: Mapping[str, CheckResult]) -> Iterator[str]:
    """Yield texts on the violated constraints, by the robots that report them."""
    for name, check in checks.items():
        broken = [shortened(" ".join(one.variables)) for one in check.shared if one.price == INFINITE]
        if broken:
            yield f"{name} finds its constraint over {broken[0]} broken"
        elif not check.allowed:
            yield f"{name} finds one of its constraints broken, which nobody else may know"


def _key(one: Charge) -> tuple[str, tuple[str, ...]]:
    return one.holder, tuple(sorted(one.variables))


def _charges(price: float) -> str:
    return {0: "holds", INFINITE: "is broken"}.get(price, f"charges {price:g}")
