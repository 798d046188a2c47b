"""Reports in Markdown: tables for a page in a repository or on a website, without figures."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from robochoc.experiments import summary
from robochoc.experiments.report_content import PAIRS_EXPLANATION, ReportContent, headed
from robochoc.experiments.results import Results
from robochoc.experiments.summary import METRICS, Table
from robochoc.formats.toml import toml_tables
from robochoc.system.files import write_atomically
from robochoc.system.plain_text import on_one_line

MOST_COLUMNS = 7
"""If there are more ways to run than this and than values of the parameter, each way has a line instead of a column."""
MOST_PAIRS = 10
"""If there are more pairs of ways to run, only the pairs with the first way are shown."""
_INTRODUCTION = re.compile(r'^text = (?:"""[^"]*"""|"[^"\n]*")\n', re.MULTILINE)


def write_markdown(results: Results, page: Path, over: str | None = None) -> None:
    """Write the report on the results of a study as one Markdown file.

    Args:
        results: The results.
        page: The file to write.
        over: The parameter of the tables. None: the study's parameter, or the first one with several values.

    Raises:
        InvalidInputError: if there are no results, or the parameter does not exist.
        OSError: if the page cannot be written.
    """
    write_atomically(page, markdown_page(results, page.name, over).encode())


def markdown_page(results: Results, name: str, over: str | None = None) -> str:
    """Return the report on the results of a study in Markdown, for a file called `name`.

    Raises:
        InvalidInputError: if there are no results, or the parameter does not exist.
    """
    return "\n\n".join(block.strip() for block in _blocks(ReportContent(results, over), name)) + "\n"


def markdown_table(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    rule = ["---"] * len(heads)
    return "".join(f"| {' | '.join(map(_cell, line))} |\n" for line in [heads, rule, *lines])


def _cell(text: str) -> str:
    return on_one_line(text).replace("|", "\\|")


def _blocks(content: ReportContent, name: str) -> Iterator[str]:
    yield f"# {on_one_line(content.title)}"
    yield from content.paragraphs
    yield " ".join(content.measured())
    yield "\n".join(f"- {on_one_line(line)}" for line in content.answers())
    yield "## Medians"
    yield "A `>=` marks a lower bound: without the limits that ended runs, the median could be higher."
    for part, rows in content.parts:
        for metric in content.metrics:
            yield f"### {headed(METRICS[metric], part)}"
            yield markdown_table(*_fitted(summary.medians(rows, metric, content.over)))
    yield "## How runs ended"
    yield markdown_table(*summary.endings(content.rows))
    yield from _solved(content)
    yield from _pairs(content)
    yield from _how_to_repeat(content, name)


def _fitted(table: Table) -> Table:
    """Return `table`, transposed if it is too wide."""
    heads, lines = table
    if len(heads) - 1 <= max(MOST_COLUMNS, len(lines)):
        return table
    first, *others = (list(column) for column in zip(heads, *lines, strict=True))
    return first, others


def _solved(content: ReportContent) -> Iterator[str]:
    """Yield the table of problems with and without a solution, unless all decided problems have a solution."""
    over = "problems" if "case" in content.rows[0] else content.over
    tables = [(part, summary.solved(rows, over)) for part, rows in content.parts]
    if any(line[3] != "0" for _, (_, lines) in tables for line in lines):
        yield "## Problems with a solution"
        for part, table in tables:
            yield from [f"### {part}"] * bool(part)
            yield markdown_table(*table)


def _pairs(content: ReportContent) -> Iterator[str]:
    cases = {row.get("case") for row in content.rows}
    first_only = len(list(itertools.combinations(summary.labels(content.rows), 2))) * len(cases) > MOST_PAIRS
    tables = list(content.pairs(first_only=first_only))
    if tables:
        yield "## Pairs"
        left = " Only those with the first way to run are shown, and all were tested." if first_only else ""
        yield f"{PAIRS_EXPLANATION} `*`: p is below 5 %.{left}"
    for name, table in tables:
        yield f"### Pairs: {name}"
        yield markdown_table(*table)


def _how_to_repeat(content: ReportContent, name: str) -> Iterator[str]:
    yield "## How to repeat it"
    yield f"Save this as `{content.name}.toml`:"
    yield f"```toml\n{_without_introduction(content.text).strip()}\n```"
    run = f"robochoc experiment run {content.name}.toml"
    yield f"```sh\n{run}\nrobochoc experiment report {content.name}.sqlite -o {name}\n```"


def _without_introduction(text: str) -> str:
    """Return a study's file without the introduction, which the page already contains; if unsure, the whole file."""
    rest = _INTRODUCTION.sub("", text)
    whole = toml_tables(text)
    whole.get("report", {}).pop("text", None)
    try:
        return rest if toml_tables(rest) == whole else text
    except ValueError:
        return text
