"""Plausibility checks of robots' reports: find a robot that lies, or two robots of which one lies. Pure.

The master has no files. It knows the robots' declarations (profiles), the conclusions that each protocol allows
(traits), and that the messages that one robot reports as sent to another must match the other's report. So a report is
compared with earlier reports by the same robot, and with reports by others. Remaining risks: docs/guides/security.md.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import field
from itertools import chain
from types import MappingProxyType
from typing import NamedTuple

from robochoc.communication.control import RobotSnapshot
from robochoc.communication.network.control_messages import Charge, CheckResult, DetailedReport, Exchanged
from robochoc.communication.network.framing import LARGEST_FRAME
from robochoc.communication.network.profile import LONGEST_NAME, MOST_VARIABLES
from robochoc.communication.quiescence import MessageCounts
from robochoc.formats.diagnostics import shortened
from robochoc.formats.names import is_name
from robochoc.model.outcome import MOST_VIOLATIONS, CheckCounts, ViolatedConstraint, Violations
from robochoc.model.problem import INFINITE, Domain
from robochoc.protocols.findings import Findings
from robochoc.protocols.traits import Traits
from robochoc.system.lazy_dataclass import dataclass

LARGEST_COUNT = 2**53
CHECKS_PER_S = 10**12
"""More constraint checks per second than any robot can do, even with precomputed tables."""
LARGEST_MEMORY = 2**50
MOST_KINDS = 100
"""An upper bound on the number of message types. A protocol has fewer."""
MOST_CHARGES = 10_000
NOTICEABLE = 100
"""The number of messages that may plausibly be in transit at the time limit."""
_ROUNDED = 1 + 2**-40
"""The tolerance for rounded costs, since some costs are sent as floats."""
HEXADECIMAL = re.compile(r"[0-9a-f]+")
_NOBODY = Exchanged(0, 0, 0)


class Doubt(NamedTuple):
    """A contradiction between the reports of two robots. One of the robots in `between` has sent a false report."""

    between: tuple[str, str]
    why: str


@dataclass(frozen=True)
class Declarations:
    """The master's knowledge before a search: the traits of the protocol, and the declarations in the profiles.

    `shown` contains the robots' variables with their domains, `dearest` the largest total cost of each robot's
    constraints.
    """

    traits: Traits = field(default_factory=Traits)
    shown: Mapping[str, Mapping[str, Domain]] = field(default_factory=lambda: MappingProxyType({}))
    dearest: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))


NOTHING_DECLARED = Declarations()


class FinishedSearch(NamedTuple):
    """The master's knowledge about a finished search.

    `order` contains its robots, `counts` are the last counters of one of them, `duration_s` is its duration in seconds.
    `by_quiescence`: the search ended by quiescence. `lossy`: robots were ordered to drop messages.
    """

    order: Collection[str]
    counts: MessageCounts
    duration_s: float
    by_quiescence: bool
    lossy: bool = False


# Checks of a single robot's reports


def fault_of_counters(counts: MessageCounts, before: MessageCounts | None) -> str:
    """Return why `counts` are invalid for a robot that had previously reported `before`; empty if they are valid."""
    if min(counts) < 0 or max(counts) > LARGEST_COUNT:
        return f"it has reported {counts.sent:,} messages sent and {counts.received:,} received, which is impossible"
    if before is not None and (counts.sent < before.sent or counts.received < before.received):
        return (
            f"its counters have fallen, from {before.sent:,} messages sent and {before.received:,} received"
            f" to {counts.sent:,} and {counts.received:,}"
        )
    return ""


def fault_of_report(name: str, account: DetailedReport, declared: Declarations, course: FinishedSearch) -> str:
    """Return why the final report `account` by the robot `name` is invalid; empty if it is valid."""
    return (
        next(_faults_of_values(name, account.assignment, declared, assigned=account.assigned), "")
        or _fault_of_metrics(account, course.duration_s)
        or _fault_of_drops(account, course)
        or _fault_of_exchange(name, account, course)
        or fault_of_findings(account.findings, course.order)
    )


def fault_of_snapshot(name: str, snapshot: RobotSnapshot, declared: Declarations, order: Collection[str]) -> str:
    """Return why `snapshot` by the robot `name` is invalid; empty if it is valid."""
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
    if values and not all(values.get(variable) in domain.possible for variable, domain in own.items()):
        yield "it has reported values that it cannot have"
    for variable in values.keys() - own.keys():
        if not is_name(variable) or len(variable) > LONGEST_NAME:
            yield "it has reported a variable with an invalid name"
        other = next((robot for robot, theirs in declared.shown.items() if variable in theirs), None)
        if other is not None:
            yield f"it has reported a value of {variable}, which is {other}'s"


def _fault_of_exchange(name: str, account: DetailedReport, course: FinishedSearch) -> str:
    exchanged = account.exchanged
    if name in exchanged or not exchanged.keys() <= set(course.order):
        return "it has reported messages with a robot that is not in the team"
    if any(not 0 <= count <= LARGEST_COUNT for one in exchanged.values() for count in one):
        return "it has reported counts that cannot be"
    if sum(account.metrics.messages.values()) != sum(one.sent for one in exchanged.values()):
        return "its total of sent messages differs from the sum of those that it has reported for each receiver"
    total = total_of(account)
    if fault := fault_of_counters(total, course.counts):
        return fault
    if course.by_quiescence and total.sent > course.counts.sent and total.received == course.counts.received:
        return "it has sent messages after quiescence, without receiving one"
    return ""


def total_of(account: DetailedReport) -> MessageCounts:
    """Return the total message counts that a robot has reported."""
    exchanged = account.exchanged.values()
    return MessageCounts(sum(one.sent for one in exchanged), sum(one.received for one in exchanged))


def _fault_of_metrics(account: DetailedReport, duration_s: float) -> str:
    spent = account.metrics
    if len(spent.messages) > MOST_KINDS or not all(
        is_name(kind) and len(kind) <= LONGEST_NAME for kind in spent.messages
    ):
        return "it has reported messages of invalid types"
    counts = (*spent.messages.values(), spent.bytes, spent.largest, spent.ncccs, spent.checks, spent.memory)
    if any(not 0 <= count <= LARGEST_COUNT for count in counts):
        return "it has reported counts that cannot be"
    sent = sum(spent.messages.values())
    if not (sent <= spent.bytes <= sent * LARGEST_FRAME and spent.largest <= spent.bytes <= sent * spent.largest):
        many = f"{sent:,} messages of {spent.bytes:,} bytes together, the largest of {spent.largest:,}"
        return f"it has reported {many}, which is impossible"
    if spent.checks > CHECKS_PER_S * (duration_s + 1):
        return f"it has reported {spent.checks:,} constraint checks in {duration_s:.1f} s, which is impossible"
    latest = max((one.clock for one in account.exchanged.values()), default=0)
    if spent.ncccs > latest + spent.checks:
        return f"its clock is at {spent.ncccs:,}, more than its {spent.checks:,} checks and received clocks explain"
    others = (spent.wall_s, spent.compile_s, spent.simulated_s)
    return "it has reported costs that are not its own" if any(others) or spent.memory > LARGEST_MEMORY else ""


def _fault_of_drops(account: DetailedReport, course: FinishedSearch) -> str:
    most = total_of(account).received if course.lossy else 0
    return "" if 0 <= account.metrics.lost_messages <= most else "it has dropped more messages than it has received"


def fault_of_findings(findings: Findings, order: Collection[str]) -> str:
    """Return why `findings` are invalid for a robot in `order`; empty if they are valid."""
    names: list[str] = []
    if findings.place is not None:
        names += [*filter(None, [findings.place.parent]), *findings.place.pseudo_parents]
    if findings.best is not None:
        names += findings.best.values
    if not set(names) <= set(order):
        return "it has reported a robot that is not in the team"
    costs = (findings.bound or 0, findings.best.cost if findings.best is not None else 0)
    if not all(0 <= cost <= INFINITE for cost in costs):
        return "it has reported impossible costs"
    if findings.share is not None and not abs(findings.share) < INFINITE:
        return "it has reported an impossible bound"
    if findings.count is not None and not HEXADECIMAL.fullmatch(findings.count):
        return "it has reported an invalid number"
    if findings.listing is not None and min(findings.listing.places, default=0) < 0:
        return "it has reported impossible optima"
    entries = findings.trail.entries if findings.trail is not None else []
    return "it has reported impossible cycles" if any(place < 0 for place in chain.from_iterable(entries)) else ""


def fault_of_check(name: str, check: CheckResult, declared: Declarations, order: Collection[str]) -> str:
    """Return why `check` by the robot `name` is invalid; empty if it is valid."""
    judged = (*check.shared, *check.copies)
    if not 0 <= check.cost <= declared.dearest.get(name, LARGEST_COUNT) * _ROUNDED < INFINITE:
        return "its constraints cost more than it has declared"
    if not (
        len(judged) <= MOST_CHARGES
        and 0 <= sum(one.constraints for one in check.shared) <= check.held <= LARGEST_COUNT
        and 0 <= check.broken <= check.hard <= check.held
        and not (check.allowed and check.broken)
    ):
        return "it has reported an impossible number of checked constraints"
    if any(one.constraints < 1 or not one.price >= 0 or not all(map(is_name, one.variables)) for one in judged):
        return "it has reported checks of invalid constraints"
    if any(one.holder != name for one in check.shared) or any(
        one.holder == name or one.holder not in order for one in check.copies
    ):
        return "it has reported checks in another robot's name"
    if check.allowed and sum(one.price for one in check.shared) > check.cost * _ROUNDED:
        return "its constraints cost more, one by one, than the total that it has reported"
    return ""


# Comparisons of two robots' reports


def doubts_about_messages(accounts: Mapping[str, DetailedReport], *, quiet: bool) -> Iterator[Doubt]:
    """Yield contradictions between two robots' reports about the messages they exchanged.

    No robot sends messages after its final report, so every received message must have been sent. If all robots were
    `quiet`, and no robot has sent or received since, every sent message must have been received.
    """
    for name, account in accounts.items():
        for other, mine in account.exchanged.items():
            theirs = accounts[other].exchanged.get(name, _NOBODY) if other in accounts else None
            if theirs is None:
                continue
            # Each pair occurs twice if both robots report messages, and once if only one robot does.
            sent, had = mine.sent, theirs.received
            if had > sent or (quiet and had < sent):
                yield Doubt((name, other), _gap(name, sent, other, had))
            if name not in accounts[other].exchanged and mine.received:
                yield Doubt((other, name), _gap(other, 0, name, mine.received))
            if mine.clock > accounts[other].metrics.ncccs:
                why = f"{name} reports {mine.clock:,} as the clock of {other} in its messages, but {other}"
                yield Doubt((other, name), f"{why} reports {accounts[other].metrics.ncccs:,} at its end")


def widest_gap(accounts: Mapping[str, DetailedReport]) -> str:
    """Return a text on the two robots with far too many messages in transit; empty if there are no such robots."""
    widest, found = 0, ""
    for name, account in accounts.items():
        for other, mine in account.exchanged.items():
            if other in accounts:
                had = accounts[other].exchanged.get(name, _NOBODY).received
                if mine.sent - had > max(widest, NOTICEABLE, had):
                    widest, found = mine.sent - had, _gap(name, mine.sent, other, had)
    return found


def _gap(name: str, sent: int, other: str, had: int) -> str:
    return f"{name} reports {sent:,} messages sent to {other}, but {other} reports {had:,} received from it"


def doubts_about_values(assignments: Mapping[str, Mapping[str, int]]) -> Iterator[Doubt]:
    """Yield variables that two robots have reported as their own."""
    owners: dict[str, str] = {}
    for name, assignment in assignments.items():
        for variable in assignment:
            other = owners.setdefault(variable, name)
            if other != name:
                yield Doubt((other, name), f"the variable {variable} is {other}'s, and {name}'s too")


def thoroughness(checks: Mapping[str, CheckResult]) -> CheckCounts:
    """Return the number of constraints that a robot besides the holder has checked, and the number of the others.

    If two robots report different numbers of constraints over the same variables, the smaller number is used.
    """
    held = sum(check.held for check in checks.values())
    seconded: dict[tuple[str, tuple[str, ...]], int] = {}
    for one in (one for check in checks.values() for one in check.copies):
        seconded[_key(one)] = max(one.constraints, seconded.get(_key(one), 0))
    both = sum(min(one.constraints, seconded.get(_key(one), 0)) for check in checks.values() for one in check.shared)
    return CheckCounts(both, held - both)


def doubts_about_checks(checks: Mapping[str, CheckResult]) -> Iterator[Doubt]:
    """Yield constraints whose costs differ between the reports of their holder and another robot that knows them."""
    prices = {_key(one): one.price for check in checks.values() for one in check.shared}
    for name, check in checks.items():
        for one in check.copies:
            charged = prices.get(_key(one))
            alike = charged is not None and math.isclose(charged, one.price, rel_tol=_ROUNDED - 1)
            if not alike and one.holder in checks:
                what = f"the constraint over {shortened(' '.join(one.variables))}"
                claim = "has no such constraint" if charged is None else f"reports that it {_charges(charged)}"
                why = f"{name} reports that {what} {_charges(one.price)}, but {one.holder}, which holds it, {claim}"
                yield Doubt((one.holder, name), why)


def objections(checks: Mapping[str, CheckResult]) -> Iterator[str]:
    """Yield texts on violated constraints, including the robots that report them."""
    for name, check in checks.items():
        broken = [shortened(" ".join(one.variables)) for one in check.shared if one.price == INFINITE]
        if broken:
            yield f"{name} finds its constraint over {broken[0]} broken"
        elif not check.allowed:
            yield f"{name} finds one of its constraints broken, which nobody else may know"


def violations_of(checks: Mapping[str, CheckResult]) -> Violations | None:
    """Return the violated constraints that the robots which hold them have reported; None if there are none."""
    first: list[ViolatedConstraint] = []
    for name, check in checks.items():
        scopes = [one.variables for one in check.shared if one.price == INFINITE]
        private = [()] * (check.broken > 0 and not scopes)
        first += [ViolatedConstraint("", name, scope) for scope in (*scopes, *private)]
    number = sum(check.broken for check in checks.values())
    hard = sum(check.hard for check in checks.values())
    return Violations(number, hard, tuple(first[:MOST_VIOLATIONS])) if number else None


def _key(one: Charge) -> tuple[str, tuple[str, ...]]:
    return one.holder, tuple(sorted(one.variables))


def _charges(price: float) -> str:
    return {0: "holds", INFINITE: "is broken"}.get(price, f"charges {price:g}")
