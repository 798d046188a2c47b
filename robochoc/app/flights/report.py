"""The report of a run: one self-contained HTML file.

Names are untrusted input: they are escaped, and the page's Content-Security-Policy allows only the scripts in the
frames with the scene and the conversation.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import msgspec

from robochoc.app.flights.answer_check import claim_words
from robochoc.app.flights.builder import flies
from robochoc.app.flights.flight_map import changed_to, happened_in
from robochoc.app.flights.flight_result import flight_result_of, flight_words, flying_robots_words
from robochoc.app.runs.options import RESULT
from robochoc.app.runs.rule_costs import Decided, rule_cost, rules_with_costs, values_by_robot, violated_links
from robochoc.app.runs.run import Run
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sentences import listed, sentence, value_words, weight_of
from robochoc.app.sketch.sketch import Sketch, SketchRule, Value
from robochoc.app.sketch.thumbnail import thumbnail
from robochoc.app.texts import LANGUAGE, say
from robochoc.model.cost_units import cost_shown
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import printable

_MOST_VALUES = 12
"""The maximum number of values listed for a decision."""
_MOST_LINKS = 4
_SCRIPTS = re.compile(rb"script-src ([^;]*);")
_HEAD_BYTES = 4096
"""The number of bytes at the start of a page that contain its policy."""


@dataclass(frozen=True)
class Pages:
    """The pages in a report: the scene and the conversation, or None."""

    flight: bytes | None = None
    conversation: bytes | None = None


@dataclass(frozen=True)
class ViolatedRule:
    """A violated rule, the robots in each violation, and the cost (None for a hard rule)."""

    rule: SketchRule
    links: tuple[tuple[str, ...], ...]
    cost: int | None


def report(sketch: Sketch, run: Run, pages: Pages, version: str) -> bytes:
    """Return the report on a run in UTF-8.

    Args:
        sketch: The sketch that was solved.
        run: The run.
        pages: The pages to include in the report.
        version: The version of robochoc.
    """
    after = changed_to(run) or sketch
    parts = [
        _answer(after, run),
        _rules(after, run),
        _frame("report.flight", pages.flight),
        _team(after),
        _messages(run),
        _frame("report.conversation", pages.conversation),
        _again(run, version),
    ]
    template = Template((files(__package__) / "report.html").read_text(encoding="utf-8"))
    return template.substitute(
        language=LANGUAGE,
        policy=escape(_policy(pages)),
        title=_text(say("report.title", name=sketch.name)),
        name=_text(sketch.name),
        when=_text(_when(run)),
        summary=_text(summary(sketch, run)),
        story="".join(f"<p>{_text(sentence)}</p>" for sentence in _story(run)),
        parts="\n".join(filter(None, parts)),
    ).encode()


def summary(sketch: Sketch, run: Run) -> str:
    """Return the outcome of a run in one sentence."""
    result = run.result
    if result is None:
        return say("report.no-answer")
    if result.epochs and not sketch.decisions:  # an imported team, whose robots may change between epochs
        there = len(result.epochs[-1].robots)
    else:
        there = len((changed_to(run) or sketch).robots)
    robots = there - len(result.withdrawn)
    verdict = "fewest" if result.verdict == "optimal" and result.withdrawn else result.verdict
    worth = run.record.maximised
    verdict = "most" if worth and verdict == "optimal" else verdict
    if result.front:
        return claim_words(run, f"{say('report.verdict.solution', robots=robots)} {result.point_in_words}")
    words = [say(f"report.verdict.{verdict}", robots=robots)] if verdict in _VERDICTS else [verdict]
    if result.withdrawn and not flying_robots_words(run):  # those words would also mention withdrawn robots
        words.append(say("report.withdrawn", names=listed(result.withdrawn)))
    if result.cost:
        words.append(say("report.worth" if worth else "report.cost", cost=cost_shown(result.cost)))
    return claim_words(run, " ".join(words))


def _story(run: Run) -> list[str]:
    """Return sentences about events, the flying robots, and problems during the flight."""
    happened = happened_in(run)
    flown = flight_result_of(run)
    return [
        *([say("fly.happened-first", what=" ".join(happened))] if happened else []),
        *flying_robots_words(run),
        *([say("fly.unsolved")] if run.result and run.result.ends_unsolved and flies(run) else []),
        *(flight_words(flown) if flown else []),
    ]


_VERDICTS = frozenset({"solution", "optimal", "most", "fewest", "no-solution", "unknown"})


def values_of(sketch: Sketch, run: Run) -> dict[tuple[str, str], Value]:
    """Return the values in an answer by robot and decision."""
    return values_by_robot(sketch, run.result.values) if run.result else {}


def _answer(sketch: Sketch, run: Run) -> str:
    if run.result and not sketch.decisions:
        pairs = [[name, value] for name, value in run.result.values.items()]
        return _section("report.answer", _table([say("report.decision"), say("report.values")], pairs)) if pairs else ""
    values = values_of(sketch, run)
    if not values:
        return ""
    rows: list[list[object]] = []
    for robot in sketch.robots:
        own = [(decision, values.get((robot.name, decision.name))) for decision in sketch.decisions]
        rows.append(
            [robot.name, *("" if value is None else value_words(sketch, decision, value) for decision, value in own)]
        )
    headings = [say("report.robot"), *(decision.name for decision in sketch.decisions)]
    return _section("report.answer", _table(headings, rows))


def _rules(sketch: Sketch, run: Run) -> str:
    if not sketch.rules:
        return ""
    values = values_of(sketch, run)
    found = {violated.rule.id: violated for violated in violated_rules(sketch, values)}
    costs = _graded_costs(sketch, values)
    items = []
    for rule in sketch.rules:
        marks = [f'<span class="soft">{_text(weight_of(rule))}</span>']
        if violated := found.get(rule.id):
            links = listed([" - ".join(robots) for robots in violated.links], _MOST_LINKS)
            key = "report.broken" if violated.cost is None else "report.broken-costs"
            marks.append(f'<span class="bad">{_text(say(key, links=links, cost=violated.cost))}</span>')
        if rule.id in costs:
            marks.append(f"<span>{_text(say('report.cost', cost=f'{costs[rule.id]:,}'))}</span>")
        items.append(f"<li>{_text(sentence(sketch, rule))} {' '.join(marks)}</li>")
    count = sum(rule.on for rule in sketch.rules)
    how = say("report.rules-broken", broken=len(found), count=count) if found else say("report.rules-kept", count=count)
    head = f"<p>{_text(how)}</p>" if values else ""
    return _section("report.rules", f"{head}<ol>{''.join(items)}</ol>")


def violated_rules(sketch: Sketch, values: Decided) -> Iterator[ViolatedRule]:
    """Yield the rules that an answer violates. Withdrawn robots violate no rules."""
    for rule in sketch.rules:
        if rule.on and rule.kind in PALETTE and (links := violated_links(sketch, rule, values)):
            yield ViolatedRule(rule, links, None if rule.cost is None else rule.cost * len(links))


def _graded_costs(sketch: Sketch, values: Decided) -> dict[str, int]:
    """Return the costs of graded rules by rule id."""
    graded = (rule for rule in rules_with_costs(sketch) if values and PALETTE[rule.kind].graded)
    return {rule.id: rule_cost(sketch, rule, values) for rule in graded}


def _team(sketch: Sketch) -> str:
    area = sketch.area
    size = say("report.map", columns=area.columns, rows=area.rows, blocked=len(area.blocked))
    decisions = []
    for decision in sketch.decisions:
        values = [value_words(sketch, decision, value) for value in sketch.values(decision)]
        who = say("list.all") if not decision.robots else listed(sketch.deciders(decision))
        decisions.append([decision.name, say(f"kind.{decision.kind}"), listed(values, _MOST_VALUES), who])
    headings = [say(f"report.{key}") for key in ("decision", "kind", "values", "who")]
    robots = [
        [robot.name, say("value.place", column=robot.at.x + 1, row=robot.at.y + 1), robot.weight, robot.rank]
        for robot in sketch.robots
    ]
    own = [say(f"report.{key}") for key in ("robot", "stands", "weight", "rank")]
    story = f"<p>{_text(sketch.story)}</p>" if sketch.story else ""
    drawn = f'<figure class="map">{thumbnail(sketch)}</figure>' if sketch.decisions else ""
    return _section(
        "report.team",
        f"{story}<p>{_text(size)}</p>{drawn}{_table(headings, decisions)}{_table(own, robots, fold=True)}",
    )


def _messages(run: Run) -> str:
    result = run.result
    if result is None:
        return ""
    facts = [
        (say("report.protocol"), result.protocol),
        (say("report.chosen"), result.chosen.get("protocol", say("report.asked-for"))),
        (say("report.order"), result.order or say("report.given")),
        (say("report.runtime"), result.runtime),
        (say("report.messages"), f"{result.messages:,}"),
        (say("report.bytes"), f"{result.metrics.bytes:,}"),
        (say("report.ncccs"), f"{result.metrics.ncccs:,}"),
        (say("report.seconds"), f"{result.metrics.wall_s:.2f} s"),
    ]
    kinds = [[kind, f"{count:,}"] for kind, count in sorted(_types(run).items())]
    table = _table([say("report.type"), say("report.messages")], kinds) if kinds else ""
    return _section("report.talk", _facts(facts) + table)


def _again(run: Run, version: str) -> str:
    seed = run.result.seed if run.result else run.record.options.seed
    facts = [(say("report.seed"), str(seed)), (say("report.version"), f"robochoc {version}")]
    command = run.command
    steps = f"<p>{_text(say('report.again-how'))}</p><pre><code>{_text(command)}</code></pre>" if command else ""
    return _section("report.again", f"{steps}{_facts(facts)}")


def _types(run: Run) -> dict[str, int]:
    """Return the number of messages of each type, if the result contains them."""
    with suppress(OSError, msgspec.MsgspecError, LookupError, TypeError, ValueError, OverflowError):
        result: dict[str, Any] = msgspec.json.decode((run.folder / RESULT).read_bytes().splitlines()[0])
        return {str(kind): int(count) for kind, count in result["metrics"]["messages_by_type"].items()}
    return {}


def _frame(key: str, page: bytes | None) -> str:
    """Return a page in a sandboxed frame."""
    if page is None:
        return ""
    inside = escape(page.decode())
    frame = f'<iframe sandbox="allow-scripts allow-downloads" title="{_text(say(key))}" srcdoc="{inside}"></iframe>'
    return f'<section class="wide"><h2>{_text(say(key))}</h2>{frame}</section>'


def _policy(pages: Pages) -> str:
    """Return the report's policy, which lists the scripts in the frames because it also applies to frames."""
    found = [_SCRIPTS.search(page[:_HEAD_BYTES]) for page in (pages.flight, pages.conversation) if page]
    scripts = " ".join(match[1].decode() for match in found if match) or "'none'"
    return (
        f"default-src 'none'; script-src {scripts}; style-src 'unsafe-inline'; img-src data: blob:;"
        " frame-src 'self'; base-uri 'none'; form-action 'none'"
    )


def _section(key: str, content: str) -> str:
    return f"<section><h2>{_text(say(key))}</h2>{content}</section>"


def _facts(facts: Iterable[tuple[str, str]]) -> str:
    return f"<dl>{''.join(f'<dt>{_text(name)}</dt><dd>{_text(fact)}</dd>' for name, fact in facts)}</dl>"


def _table(headings: Sequence[str], rows: Sequence[Sequence[object]], *, fold: bool = False) -> str:
    head = "".join(f'<th scope="col">{_text(heading)}</th>' for heading in headings)
    body = "".join(f"<tr>{''.join(f'<td>{_text(str(cell))}</td>' for cell in row)}</tr>" for row in rows)
    table = f'<div class="table"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'
    return f"<details><summary>{_text(say('report.robots'))}</summary>{table}</details>" if fold else table


def _when(run: Run) -> str:
    with suppress(OverflowError, ValueError, OSError):  # a file from elsewhere may contain any number
        return datetime.fromtimestamp(run.record.started, UTC).strftime("%Y-%m-%d %H:%M UTC")
    return ""


def _text(text: str) -> str:
    return escape(printable(text))
