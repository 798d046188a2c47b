"""An outcome in words, for people."""

from __future__ import annotations

import re
from collections.abc import Mapping

from robochoc.formats import on_one_line
from robochoc.formats.diagnostics import shortened
from robochoc.model.change import team_after_events
from robochoc.model.outcome import ALL_ROBOTS, Metrics, Outcome, Verdict
from robochoc.model.priorities import natural_key
from robochoc.model.problem import ProblemKind, Team

WIDTH = 100
_LARGE = 1 << 16
"""Bytes: a message as large as that is worth a word."""
_CELL = re.compile(r"[A-Za-z_]+([0-9]+)[._]([0-9]+)")


def report(team: Team, outcome: Outcome) -> str:
    """The verdict, why, where everybody flies, and what it cost, in a few lines."""
    lines = [f"{on_one_line(outcome.team)}: {_verdict(team, outcome)}", *_epochs(outcome)]
    team = team_after_events(team, outcome.events)
    if outcome.assignment:
        lines += _board(team, outcome.assignment) or _list(team, outcome.assignment)
    if outcome.aside:
        flying, aside = len(team.robots) - len(outcome.withdrawn), len(outcome.aside)
        fly, step = "flies" if flying == 1 else "fly", "steps" if aside == 1 else "step"
        lines.append(f"  {flying} {fly}, {aside} {step} aside{_weight(team, outcome)}:")
        lines += _wrapped(outcome.aside)
    if outcome.lost:
        lost = sorted(outcome.lost, key=natural_key)
        lines += [f"  {len(lost)} {'was' if len(lost) == 1 else 'were'} lost:", *_wrapped(lost)]
    order = f", order {outcome.order}" if outcome.order else ""
    lines.append(f"  {outcome.protocols}{order}, {_place(team, outcome)}: {_metrics(outcome)}{_simulated(outcome)}")
    return "\n".join(map(on_one_line, lines))


def _epochs(outcome: Outcome) -> list[str]:
    """A line for each epoch: what opened it, and how it ended."""
    if not outcome.epochs:
        return []
    central = outcome.runtime == "central"
    rows = [("epoch", "opened by", "robots", "verdict", *(("seconds",) if central else ("messages", "NCCCs")))]
    for number, epoch in enumerate(outcome.epochs):
        verdict = f"{epoch.verdict}{', confirmed' * (epoch.verified and epoch.verdict is Verdict.NO_SOLUTION)}"
        spent = epoch.metrics
        counts = (f"{sum(spent.messages.values()):,}", f"{spent.ncccs:,}")
        cost = (f"{spent.wall_s:.2f}",) if central else counts
        opened = shortened(on_one_line(epoch.opened_by))
        rows.append((f"{number}", opened, f"{len(epoch.robots)}", verdict, *cost))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    numbers = {0, 2, 4, 5}
    return [
        "  " + "  ".join(f"{cell:{'>' if place in numbers else '<'}{widths[place]}}" for place, cell in enumerate(row))
        for row in rows
    ]


def _place(team: Team, outcome: Outcome) -> str:
    match outcome.runtime:
        case "processes" | "network":
            seed = f", seed {outcome.seed}" if outcome.order == "random" else ""
            joined = " on a network" * (outcome.runtime == "network")
            return f"{len(team.robots)} process{'es' * (len(team.robots) != 1)}{joined}{seed}"
        case "central":
            return "one model of all files merged"
        case _:
            return f"{outcome.runtime}, seed {outcome.seed}"


def _verdict(team: Team, outcome: Outcome) -> str:
    why = outcome.ruled_out
    if outcome.reason and not outcome.epochs:
        why = outcome.reason
    confirmed = ", confirmed centrally" * outcome.confirmed
    left = " for the robots that are left" if outcome.lost else ""
    match outcome.verdict:
        case Verdict.NO_SOLUTION:
            proof = f"no solution{left} ({why})" if why else f"no solution{left}"
            return f"{proof}, confirmed centrally" if outcome.verified else proof
        case Verdict.UNKNOWN:
            return f"unknown: {outcome.reason or 'a limit was reached before a verdict'}{_so_far(team, outcome)}"
        case _ if outcome.count is not None:
            return f"{outcome.count:,} solution{'s' * (outcome.count != 1)}"
        case Verdict.SOLUTION | Verdict.OPTIMAL if not outcome.aside:
            return f"{_proven(team, outcome)}{left}, {_checked(outcome)}{confirmed}{_trusted(outcome)}"
        case Verdict.SOLUTION | Verdict.OPTIMAL:
            who = "some step" if outcome.assignment else "all step"
            if outcome.verdict is Verdict.OPTIMAL:
                by_weight = ", by weight" if _weight(team, outcome) else ""
                who = f"as few as possible{by_weight} (proven) step"
            whole = left or " for the whole team"
            because = f" ({why})" if why else ""
            return f"no solution{whole}{because}; {who} aside, {_checked(outcome)}{confirmed}{_trusted(outcome)}"


def _checked(outcome: Outcome) -> str:
    """Return who checked the constraints, in words. Across machines that may be their owners alone."""
    if not outcome.verified:
        return f"not checked: {outcome.reason}"
    if outcome.checked is None or not outcome.checked.by_owner:
        return "checked against every constraint"
    alone, total = outcome.checked.by_owner, sum(outcome.checked)
    return f"checked; on their owner's word alone: {alone:,} of {total:,} constraint{'s' * (total != 1)}"


def _trusted(outcome: Outcome) -> str:
    """Return, in words, which claim rests on all robots' word because nobody could check it."""
    if outcome.claimed_by != ALL_ROBOTS or not outcome.verified or outcome.confirmed:
        return ""
    what = "that no fewer could step aside" if outcome.aside else "that nothing costs less"
    return f"; {what} rests on all robots' word"


def _proven(team: Team, outcome: Outcome) -> str:
    """The verdict, and the cost where there are costs."""
    if team.kind is ProblemKind.DISCSP:
        return outcome.verdict
    least = "" if outcome.verdict is Verdict.OPTIMAL else ", which may not be the least"
    return f"{outcome.verdict}, cost {_number(outcome.cost)}{least}"


def _weight(team: Team, outcome: Outcome) -> str:
    """What those weigh that step aside, where robots are not all of weight 1."""
    if all(robot.weight == 1 for robot in team.robots):
        return ""
    return f" (weight {sum(team[name].weight for name in outcome.aside)})"


def _number(cost: float | None) -> str:
    """Costs are integers, and may be larger than floats are exact."""
    return "unknown" if cost is None else f"{int(cost):,}"


def _so_far(team: Team, outcome: Outcome) -> str:
    """The best that is known when a limit is reached, and what it could come to at best."""
    bound = outcome.bound
    if outcome.aside:
        least = f"; at least {_number(bound)} have to" if bound else ""
        step = "steps" if len(outcome.aside) == 1 else "step"
        return f"; in the best answer so far {len(outcome.aside)} {step} aside{_weight(team, outcome)}{least}"
    if team.kind is ProblemKind.DISCSP:
        return ""
    known = [f"the best so far costs {_number(outcome.cost)}"] if outcome.assignment else []
    word = ", by all robots' word" if outcome.claimed_by else ""
    known += [f"nothing costs less than {_number(bound)}{word}"] if bound else []
    return "; " + ", and ".join(known) if known else ""


def _metrics(outcome: Outcome) -> str:
    spent = outcome.metrics
    if outcome.runtime == "central":
        return f"{spent.wall_s:.2f} s"
    kinds = sorted(spent.messages.items(), key=lambda item: -item[1])
    types = ", ".join(f"{count:,} {kind}" for kind, count in kinds)
    total = sum(spent.messages.values())
    return (
        f"{total:,} message{'s' * (total != 1)} ({types or 'none'}), {spent.bytes:,} bytes{_largest(spent)},"
        f" {spent.ncccs:,} NCCCs, {spent.checks:,} checks, {spent.wall_s:.2f} s{_local(spent)}"
    )


def _largest(spent: Metrics) -> str:
    """The largest message, where it is a large one."""
    return f" (the largest message {spent.largest:,})" if spent.largest >= _LARGE else ""


def _local(spent: Metrics) -> str:
    """What compiling and keeping local solutions cost, where there were any."""
    if not spent.compile_s:
        return ""
    memory = f", {spent.memory / 2**20:.1f} MiB in the largest process" if spent.memory else ""
    return f" after {spent.compile_s:.2f} s of compiling{memory}"


def _simulated(outcome: Outcome) -> str:
    """What it would have taken by radio, where a channel model was asked for."""
    if outcome.channel is None:
        return ""
    seconds = outcome.metrics.simulated_s
    return f"; {f'{seconds:,.2f} s' if seconds >= 1 else f'{seconds * 1000:,.2f} ms'} simulated ({outcome.channel})"


def _board(team: Team, assignment: Mapping[str, int]) -> list[str]:
    """A table of rows and columns, if variables are named for cells (`V3.1`) and the board is not too wide."""
    cells = {}
    for name in team.variables:
        match = _CELL.fullmatch(name)
        if not match:
            return []
        cells[int(match[1]), int(match[2])] = str(assignment.get(name, "-"))
    rows, columns = sorted({row for row, _ in cells}), sorted({column for _, column in cells})
    width = 2 + max(len(text) for text in (*cells.values(), str(columns[-1])))
    if width * len(columns) > WIDTH or len(cells) != len(rows) * len(columns):
        return []
    head = "  row\\column" + "".join(f"{column:>{width}}" for column in columns)
    return [head, *(f"  {row:>10}" + "".join(f"{cells[row, column]:>{width}}" for column in columns) for row in rows)]


def _list(team: Team, assignment: Mapping[str, int]) -> list[str]:
    owners = sorted({team.owner[name] for name in assignment}, key=natural_key)
    own = {owner: [variable.name for variable in team[owner].variables] for owner in owners}
    values = {owner: ", ".join(f"{name} = {assignment[name]}" for name in names) for owner, names in own.items()}
    return _wrapped([f"{owner}: {values[owner]}" for owner in owners])


def _wrapped(words: tuple[str, ...] | list[str]) -> list[str]:
    """Words in columns, as many as fit."""
    width = 2 + max(len(word) for word in words)
    per_line = max(1, WIDTH // width)
    return [
        "    " + "".join(f"{word:<{width}}" for word in words[start : start + per_line]).rstrip()
        for start in range(0, len(words), per_line)
    ]
