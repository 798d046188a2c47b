"""The outcome of a run as text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from decimal import Decimal
from typing import TYPE_CHECKING

from robochoc.cli.reports.table import table_lines
from robochoc.formats import on_one_line
from robochoc.formats.diagnostics import shortened
from robochoc.formats.headline import describe_outcome
from robochoc.maps.places import MapPlaces, Place
from robochoc.model.change import team_after_events
from robochoc.model.cost_units import Cost, cost_shown
from robochoc.model.outcome import ALL_ROBOTS, BEST_FOR_SAMPLES, CENTRAL_SOLVER, Metrics, Outcome, Verdict
from robochoc.model.policies import PolicyReport
from robochoc.model.priorities import natural_key
from robochoc.model.problem import ProblemKind, Robot, Team
from robochoc.system.garbage import collection_paused
from robochoc.system.plain_text import counted

if TYPE_CHECKING:
    from robochoc.maps.ground_map import GroundMap

WIDTH = 100
_LARGE = 1 << 16
"""The size in bytes from which a message is mentioned."""
_MOST_POINTS = 30
"""The maximum number of points of a Pareto front listed in a report."""
_MOST_DROPPED = 3
"""The maximum number of dropped constraints listed in a report."""
_CELL = re.compile(r"[A-Za-z_]+([0-9]+)[._]([0-9]+)")
_ONLY, _NONE, _START, _TOUR = "task", "none", ".start", "tour"
"""A robot with at most one task has one variable, whose first value means no task (`tasks/builder.py`)."""


@collection_paused()
def outcome_report(team: Team, outcome: Outcome, ground: GroundMap | None = None) -> str:
    """Return the verdict with its reason, the values, the withdrawn and lost robots, and the metrics, on a few lines.

    Values that are places on the team's map `ground` are followed by their position in metres.
    """
    lines = [f"{on_one_line(outcome.team)}: {_verdict(team, outcome)}", *_epochs(outcome)]
    team = team_after_events(team, outcome.events)
    places = MapPlaces(team, ground)
    if outcome.assignment:
        lines += _values(team, outcome.labelled(outcome.assignment), places.places_of(outcome.assignment))
    lines += [*_front(outcome), *_listed(team, outcome, places), *_uncertainty(team, outcome)]
    if outcome.withdrawn_alive:
        lines += [
            f"  {len(outcome.withdrawn_alive)} withdrawn{_weight(team, outcome)}:",
            *_wrapped(outcome.withdrawn_alive),
        ]
    if outcome.lost:
        lost = sorted(outcome.lost, key=natural_key)
        lines += [f"  {len(lost)} lost:", *_wrapped(lost)]
    lines += [*_dropped(outcome), *_chosen(outcome), *_stages(outcome), *_grids(outcome), *_preprocessing(outcome)]
    order = f", order {outcome.order}" if outcome.order else ""
    lines.append(f"  {outcome.protocols}{order}, {_place(team, outcome)}: {_metrics(outcome)}{_simulated(outcome)}")
    return "\n".join(map(on_one_line, lines))


def _uncertainty(team: Team, outcome: Outcome) -> list[str]:
    """Return a line with the expected and the worst cost, if the problem has random variables and costs."""
    report = outcome.uncertainty
    if report is None or team.kind == ProblemKind.DISCSP:
        return []
    lines = _samples(report)
    if report.expected is None:
        return lines
    scenarios = counted(report.scenarios, "scenario")
    worst = f"unknown: there are {scenarios}"
    if report.worst is not None:
        case = ", ".join(f"{shortened(name)} = {value}" for name, value in report.worst_scenario.items())
        worst = f"{cost_shown(report.worst)} ({case or 'the same'}), of {scenarios}"
    return [f"  expected cost {cost_shown(report.expected)}; worst case {worst}", *lines]


def _samples(report: PolicyReport) -> list[str]:
    """Return a line with the cost for samples, if they replaced expectations."""
    sampled = report.sampled
    if sampled is None:
        return []
    line = f"  cost {cost_shown(sampled.cost)} for {counted(sampled.samples, 'sample')}"
    if sampled.low is not None and sampled.high is not None:
        interval = f"{cost_shown(sampled.low)} to {cost_shown(sampled.high)}"
        line += f"; expected cost {interval} (95 % confidence, {sampled.method}, {sampled.fresh:,} other samples)"
    elif report.expected is None:
        line += "; expected cost unknown: its range could not be bounded"
    return [line]


def _front(outcome: Outcome) -> list[str]:
    """Return a table of the points of the Pareto front; the first one has the values above."""
    if not outcome.front:
        return []
    names = (*outcome.front[0].objectives,)
    rows = [
        (str(number), *map(_number, point.objectives.values()))
        for number, point in enumerate(outcome.front[:_MOST_POINTS], 1)
    ]
    more = len(outcome.front) - len(rows)
    rest = [f"and {counted(more, 'more point')} (--json lists all, with their values)"] if more else []
    table = table_lines(("point", *names), rows, right=("point", *names))
    return [f"  {line}" for line in (*table, *rest)]


def _dropped(outcome: Outcome) -> list[str]:
    """Return a line that lists the first constraints dropped because robots in them are absent."""
    dropped = outcome.dropped_constraints
    if not dropped:
        return []
    named = [f"{one.name} ({', '.join(map(shortened, one.robots))})" for one in dropped[:_MOST_DROPPED]]
    others = len(dropped) - len(named)
    more = f" and {others:,} more" if others else ""
    verb = "was" if len(dropped) == 1 else "were"
    what = counted(len(dropped), "constraint")
    return [f"  {what} {verb} dropped, as robots in them are absent: {', '.join(named)}{more}"]


def _chosen(outcome: Outcome) -> list[str]:
    """Return a line with the chosen protocol and order, and the reasons; empty if the user chose both."""
    names = {"protocol": outcome.protocol, "order": f"order {outcome.order}"}
    words = [f"{names[part]}, as {why}" for part, why in outcome.chosen.items() if part in names]
    return [f"  chosen: {'; '.join(words)}"] if words else []


def _stages(outcome: Outcome) -> list[str]:
    """Return a line with the protocols that searched in turn, if there were several."""
    if not outcome.stages:
        return []
    words = []
    for stage in outcome.stages:
        searches = f" in {stage.searches:,} searches" if stage.searches > 1 else ""
        cost = "" if stage.cost is None else f": {_number(stage.cost)}"
        words.append(f"{stage.protocol} {stage.seconds:.2f} s{searches}{cost}")
    return [f"  stages: {'; '.join(words)}"]


def _grids(outcome: Outcome) -> list[str]:
    """Return a line about the grids of real variables, if there are any."""
    if not outcome.grids:
        return []
    first, last = outcome.grids[0], outcome.grids[-1]
    costs = f", cost {_number(first.cost)} to {_number(last.cost)}" if first.cost is not None else ""
    return [f"  {counted(len(outcome.grids), 'grid')}: step {first.step:g} to {last.step:g}{costs}"]


def _preprocessing(outcome: Outcome) -> list[str]:
    """Return a line about the preprocessing, if there was any."""
    done = outcome.preprocessing
    if done is None:
        return []
    return [f"  before: {done.name} removed {done.removed:,} of {done.values:,} values: {_spent(done.metrics)}"]


def _epochs(outcome: Outcome) -> list[str]:
    """Return a table of the epochs, with the event that started each epoch, and the verdict."""
    if not outcome.epochs:
        return []
    counts = ("seconds",) if outcome.runtime == "central" else ("messages", "NCCCs")
    rows = []
    for number, epoch in enumerate(outcome.epochs):
        verdict = f"{epoch.verdict}{', confirmed' * (epoch.verified and epoch.verdict == Verdict.NO_SOLUTION)}"
        spent = epoch.metrics
        cost = {
            "seconds": f"{spent.wall_s:.2f}",
            "messages": f"{sum(spent.messages.values()):,}",
            "NCCCs": f"{spent.ncccs:,}",
        }
        cells = (str(number), shortened(epoch.opened_by), str(len(epoch.robots)), verdict)
        rows.append((*cells, *(cost[count] for count in counts)))
    headings = ("epoch", "opened by", "robots", "verdict", *counts)
    return [f"  {line}" for line in table_lines(headings, rows, right=("epoch", "robots", *counts))]


def _place(team: Team, outcome: Outcome) -> str:
    match outcome.runtime:
        case "processes" | "network":
            seed = f", seed {outcome.seed}" if outcome.order == "random" else ""
            joined = " on a network" * (outcome.runtime == "network")
            return f"{len(team.robots)} process{'es' * (len(team.robots) != 1)}{joined}{seed}"
        case "central":
            solvers = f", solved by {' and '.join(outcome.solved_by)}" if outcome.solved_by else ""
            return f"one model of all files merged{solvers}"
        case _:
            return f"{outcome.runtime}, seed {outcome.seed}"


def _verdict(team: Team, outcome: Outcome) -> str:
    """Return the verdict, its reason, and how it was checked."""
    is_impossible = outcome.verdict == Verdict.NO_SOLUTION
    why = outcome.reason if outcome.reason and (is_impossible or not outcome.epochs) else outcome.ruled_out
    because = f" ({why})" if why else ""
    confirmed = _confirmed(outcome)
    left = " for the robots that are left" if outcome.lost else ""
    weighted = bool(_weight(team, outcome))
    headline = describe_outcome(outcome, len(team.robots), weighted=weighted)
    match outcome.verdict:
        case Verdict.NO_SOLUTION:
            return f"no solution{left}{because}{confirmed or ', confirmed centrally' * outcome.verified}"
        case Verdict.UNKNOWN:
            return f"unknown: {outcome.reason or 'a limit was reached before a verdict'}{_so_far(team, outcome)}"
        case _ if outcome.count is not None:
            return headline
        case Verdict.SOLUTION | Verdict.OPTIMAL if not outcome.withdrawn_alive:
            unfinished = f"; {outcome.reason}" * _is_unfinished(outcome)
            proof = f"{_not_proven(team, outcome)}, {_checked(outcome)}{confirmed}{_trusted(team, outcome)}"
            return f"{headline}{proof}{unfinished}"
        case Verdict.SOLUTION | Verdict.OPTIMAL:
            by = _by_the_deadline(outcome)
            rest = (
                f"{by.strip()}, not proven to be the minimum"
                if by
                else f"no solution{left or ' for the whole team'}{because}"
            )
            return f"{headline}; {rest}; {_checked(outcome)}{confirmed}{_trusted(team, outcome)}"


def _is_unfinished(outcome: Outcome) -> bool:
    """Return whether the run stopped at a checked solution because a message was lost."""
    return outcome.verified and outcome.reason is not None and outcome.metrics.lost_messages > 0


def _confirmed(outcome: Outcome) -> str:
    """Return the solvers that confirmed the verdict."""
    if not outcome.confirmed:
        return ""
    solvers = ["centrally" if name == CENTRAL_SOLVER else f"by {name}" for name in outcome.confirmed_by]
    return f", confirmed {' and '.join(solvers) or 'centrally'}"


def _checked(outcome: Outcome) -> str:
    """Return how the constraints were checked. On several machines, some may only be checked by their owner."""
    if not outcome.verified:
        return f"not checked: {outcome.reason}"
    if outcome.checked is None or not outcome.checked.by_owner:
        return f"checked against every constraint{' that remains' * (not outcome.is_complete)}"
    alone, total = outcome.checked.by_owner, sum(outcome.checked)
    return f"checked; by their owner only: {alone:,} of {total:,} constraint{'s' * (total != 1)}"


def _trusted(team: Team, outcome: Outcome) -> str:
    """Return the claim that could not be checked, and depends on the reports of all robots."""
    if outcome.claimed_by != ALL_ROBOTS or not outcome.verified or outcome.confirmed:
        return ""
    what = "the minimum withdrawal" if outcome.withdrawn_alive else f"the {_best(team)} cost"
    return f"; {what} is as reported by all robots"


def _not_proven(team: Team, outcome: Outcome) -> str:
    known = team.kind == ProblemKind.DISCSP or outcome.verdict == Verdict.OPTIMAL
    by = _by_the_deadline(outcome)
    if known:
        return by
    if outcome.reason == BEST_FOR_SAMPLES:
        return f"{by} (the best for the samples)"
    if outcome.grids and outcome.cost is not None and outcome.bound is not None:
        gap, bound = abs(Decimal(outcome.cost) - Decimal(outcome.bound)), _number(outcome.bound)
        return f"{by} (at most {_number(gap)} from the {_best(team)}: {_side(team)} bound {bound})"
    bound = (
        f"; {_side(team)} bound {_number(outcome.bound)}"
        if outcome.bound and (by or not outcome.withdrawn_alive)
        else ""
    )
    return f"{by} (not proven to be the {_best(team)}{bound})"


def _by_the_deadline(outcome: Outcome) -> str:
    """Return the time of the answer, if the search was ended by the deadline."""
    if outcome.deadline is None:
        return ""
    by = f" by the deadline of {outcome.deadline:g} s"
    better = [f"{one.at_s:.1f} s" for one in outcome.improvements[1:]]
    return f"{by}, improved after {better[-1]}" if better else by


def _maximizes(team: Team) -> bool:
    """Return whether the team's costs are utilities, or were utilities before the team was normalised."""
    return any(robot.costs.maximize or robot.user_units.maximize for robot in team.robots)


def _best(team: Team) -> str:
    return "maximum" if _maximizes(team) else "minimum"


def _side(team: Team) -> str:
    """Return whether bounds on the cost are upper or lower bounds."""
    return "upper" if _maximizes(team) else "lower"


def _weight(team: Team, outcome: Outcome) -> str:
    """Return the weight of the withdrawn robots, if the robots have different weights."""
    if all(robot.weight == 1 for robot in team.robots):
        return ""
    return f" (weight {sum(team[name].weight for name in outcome.withdrawn_alive)})"


def _number(cost: Cost | None) -> str:
    return "unknown" if cost is None else cost_shown(cost)


def _so_far(team: Team, outcome: Outcome) -> str:
    """Return the incumbent and the lower bound at the time when a limit was reached."""
    bound = outcome.bound
    if outcome.withdrawn_alive:
        lower = f" (lower bound {_number(bound)})" if bound else ""
        withdraw = "withdraws" if len(outcome.withdrawn_alive) == 1 else "withdraw"
        return f"; in the best answer so far {len(outcome.withdrawn_alive)} {withdraw}{_weight(team, outcome)}{lower}"
    if team.kind == ProblemKind.DISCSP:
        return ""
    verb = "is worth" if _maximizes(team) else "costs"
    known = [f"the best so far {verb} {_number(outcome.cost)}"] if outcome.assignment else []
    reported = ", as reported by all robots" if outcome.claimed_by else ""
    known += [f"{_side(team)} bound {_number(bound)}{reported}"] if bound else []
    return "; " + ", and ".join(known) if known else ""


def _metrics(outcome: Outcome) -> str:
    spent = outcome.metrics
    if outcome.runtime == "central":
        return f"{spent.wall_s:.2f} s"
    return f"{_spent(spent)}{_local(spent)}"


def _spent(spent: Metrics) -> str:
    """Return the messages, NCCCs, checks and time of a search."""
    kinds = sorted(spent.messages.items(), key=lambda item: -item[1])
    types = ", ".join(f"{count:,} {kind}" for kind, count in kinds)
    total = sum(spent.messages.values())
    return (
        f"{total:,} message{'s' * (total != 1)} ({types or 'none'}), {spent.bytes:,} bytes{_largest(spent)},"
        f"{_lost(spent)} {spent.ncccs:,} NCCCs, {spent.checks:,} checks,{_cycles(spent)} {spent.wall_s:.2f} s"
    )


def _lost(spent: Metrics) -> str:
    """Return the number of lost messages, if there were any."""
    return f" {spent.lost_messages:,} of the messages lost," if spent.lost_messages else ""


def _cycles(spent: Metrics) -> str:
    """Return the number of cycles, if they were counted."""
    return f" {spent.cycles:,} cycle{'s' * (spent.cycles != 1)}," if spent.cycles else ""


def _largest(spent: Metrics) -> str:
    """Return the size of the largest message, if it is large."""
    return f" (the largest message {spent.largest:,})" if spent.largest >= _LARGE else ""


def _local(spent: Metrics) -> str:
    """Return the time and memory needed for local problems, if there were any."""
    if not spent.compile_s:
        return ""
    memory = f", {spent.memory / 2**20:.1f} MiB in the largest process" if spent.memory else ""
    return f" after {spent.compile_s:.2f} s of compiling{memory}"


def _simulated(outcome: Outcome) -> str:
    """Return the simulated time, if a channel model was used."""
    if outcome.channel is None:
        return ""
    seconds = outcome.metrics.simulated_s
    return f"; {f'{seconds:,.2f} s' if seconds >= 1 else f'{seconds * 1000:,.2f} ms'} simulated ({outcome.channel})"


def _values(team: Team, assignment: Mapping[str, float | str], places: Mapping[str, Place]) -> list[str]:
    """Return a table of tasks, a board, or a list of values, with their positions if these are known."""
    if tasks := task_table(team, assignment):
        return tasks
    if places:
        return _list(team, {name: f"{value}{_at(places.get(name))}" for name, value in assignment.items()})
    return _board(team, assignment) or _list(team, assignment)


def _at(place: Place | None) -> str:
    """Return the suffix for a value that is a place: its position in metres, in the form of the options for maps."""
    return f" ({','.join(f'{part:.10g}' for part in place)} m)" if place else ""


def _board(team: Team, assignment: Mapping[str, float | str]) -> list[str]:
    """Return a board, if variables are named after its cells (`V3.1`) and it is not too wide."""
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


def _list(team: Team, assignment: Mapping[str, float | str]) -> list[str]:
    owners = sorted({team.owner[name] for name in assignment}, key=natural_key)
    own = {owner: [variable.name for variable in team[owner].variables] for owner in owners}
    values = {owner: ", ".join(f"{name} = {assignment[name]}" for name in names) for owner, names in own.items()}
    alike = own == {owner: [owner] for owner in owners}
    return _wrapped([values[owner] if alike else f"{owner}: {values[owner]}" for owner in owners])


def task_table(team: Team, values: Mapping[str, float | str]) -> list[str]:
    """Return a table of robots and their tasks (`tasks.yaml`), and the unassigned tasks; empty for other problems."""
    could = {robot.name: _tasks_of(robot) for robot in team.robots}
    if not all(could.values()):
        return []
    done = {
        robot: [task for task, (variable, value) in tasks.items() if values.get(variable) == value]
        for robot, tasks in could.items()
    }
    starts = {
        (robot, task): f" (starts at {values[own + _START]})"
        for robot, tasks in could.items()
        for task, (own, _) in tasks.items()
        if own + _START in values
    }
    rows = [
        (robot, ", ".join(task + starts.get((robot, task), "") for task in tasks) or "-")
        for robot, tasks in sorted(done.items(), key=lambda row: natural_key(row[0]))
    ]
    assigned = {task for tasks in done.values() for task in tasks}
    left = sorted({task for tasks in could.values() for task in tasks} - assigned, key=natural_key)
    return [
        *(f"    {line}" for line in table_lines(("robot", "does"), rows)),
        *([f"    not assigned: {', '.join(left)}"] if left else []),
    ]


def _tasks_of(robot: Robot) -> dict[str, tuple[str, float | str]]:
    """Return the variable and the value by which `robot` does each task; empty if the robot has any other variable."""
    first = f"{robot.name}."
    if [one.name for one in robot.variables] == [first + _ONLY]:
        only = robot.variables[0]
        labels = [only.domain.label(value) for value in only.domain]
        if labels[:1] == [_NONE]:
            return {str(label): (only.name, label) for label in labels[1:]} or {_NONE: (only.name, 0)}
    names = {one.name for one in robot.variables}
    does = [one for one in robot.variables if one.name.removesuffix(_START) not in names - {one.name}]
    does = [one for one in does if one.name != first + _TOUR]
    binary = (not one.domain.symbols and set(one.domain) == {0, 1} for one in does)
    if all(one.name.startswith(first) for one in robot.variables) and all(binary):
        return {one.name.removeprefix(first): (one.name, 1) for one in does}
    return {}


def _listed(team: Team, outcome: Outcome, places: MapPlaces) -> list[str]:
    """Return the listed optima except the first, which is the assignment."""
    if outcome.optima is None:
        return []
    sampled = outcome.reason == BEST_FOR_SAMPLES
    one, many = ("optimum", "optima") if sampled or outcome.verdict == Verdict.OPTIMAL else ("solution", "solutions")
    of = " of the samples" if sampled else ""
    number, others = Decimal(outcome.optima.number), outcome.optima.assignments[1:]
    if number == 1:
        return [f"  there is no other {one}{of}"]
    shown = f"the first {len(others) + 1:,}" if len(others) + 1 < number else "all"
    lines = [f"  one of {number:,} {many}{of}; {shown} are listed, the others are:"]
    for place, other in enumerate(others, start=2):
        lines += [f"  {place:,}.", *_values(team, outcome.labelled(other), places.places_of(other))]
    return lines


def _wrapped(words: tuple[str, ...] | list[str]) -> list[str]:
    """Return words arranged in as many columns as fit."""
    width = 2 + max(len(word) for word in words)
    per_line = max(1, WIDTH // width)
    return [
        "    " + "".join(f"{word:<{width}}" for word in words[start : start + per_line]).rstrip()
        for start in range(0, len(words), per_line)
    ]
