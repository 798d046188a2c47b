"""`robochoc journal`: summarises a journal, and exports it for other programs."""

from __future__ import annotations

import shlex
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.paths import InputPath, OutputFile, refuse_same_places
from robochoc.cli.options.saved import SavedTrace, saved_trace
from robochoc.cli.options.value_types import WholeNumber
from robochoc.cli.reports.failures import INVALID, USAGE, Failure
from robochoc.system.errors import RobochocError

if TYPE_CHECKING:
    from robochoc.sniffer.selection import Selection

FORMATS = ("words", "jsonl", "acl", "csv", "mermaid", "html", "costs")
MOST_IN_PAGE = 100_000
"""The maximum number of messages in a page. With more, the page would be too large for browsers."""


@click.group()
def journal() -> None:
    """Show or export a journal: all messages and decisions of a run ('robochoc solve --journal FILE')."""


@journal.command(short_help="Summarise a journal.")
@click.argument("file", type=InputPath(), metavar="FILE")
def show(file: Path) -> None:
    """Summarise a journal: run, robots, messages by type, outcome, and whether the file is complete."""
    from robochoc.cli.reports.journal import journal_report

    with saved_trace(file) as saved:
        for line in journal_report(saved.trace):
            click.echo(line)


@journal.command(short_help="Write messages for other programs, or as a page.")
@click.argument("file", type=InputPath(), metavar="FILE")
@click.option("--format", "form", type=click.Choice(FORMATS), required=True, help="Format (see above).")
@click.option("-o", "--output", type=OutputFile(), metavar="FILE", help="File to write.  [default: standard output]")
@click.option("--robots", default="", metavar="PATTERNS", help="Only messages between these robots: Robot3.1,Robot2.*")
@click.option("--types", default="", metavar="PATTERNS", help="Only messages of these types: Ok,Nogood")
@click.option(
    "--from", "first", type=WholeNumber(0), default=0, metavar="N", help="First message. Messages are numbered from 0."
)
@click.option("--to", "last", type=WholeNumber(0), metavar="N", help="Last message.")
@click.option("--conversation", type=WholeNumber(1), metavar="N", help="Only run (or epoch) N, numbered from 1.")
def export(
    file: Path,
    form: str,
    output: Path | None,
    robots: str,
    types: str,
    first: int,
    last: int | None,
    conversation: int | None,
) -> None:
    """Export all or selected messages of the journal FILE.

    \b
    words    each robot's steps: messages received, reasons, messages sent
    jsonl    the journal as text, one JSON object per line; robochoc reads it
    acl      FIPA ACL messages as text (FIPA00070), one per line
    csv      a table with one row per message: cause, explanation, content
    mermaid  a sequence diagram for Markdown pages
    html     the sniffer's page in one file, without a server
    costs    a table (CSV) with one row per improvement: time, messages until then, cost

    In PATTERNS, * matches any characters and ? one character. Messages have the same numbers as in the sniffer.
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.sniffer.patterns import patterns_in
    from robochoc.sniffer.selection import NothingSelectedError, Selection

    selection = Selection(patterns_in(robots), patterns_in(types), first, last, conversation)
    refuse_same_places({"-o": output}, {"the journal": file})
    with saved_trace(file) as saved:
        if form == "costs":
            if selection != Selection():
                raise click.UsageError(
                    "--format costs exports no messages: remove --robots, --types, --from, --to, ..."
                )
            _export_costs(saved, file, output)
            return
        try:
            messages = selection.numbers_in(saved.trace)
        except NothingSelectedError as nothing:
            raise click.UsageError(_one_line(str(nothing))) from nothing
        if saved.trace.damage:
            click.echo(_one_line(f"{file}: only a part of the journal can be read: {saved.trace.damage}"), err=True)
        options = {"--robots": robots, "--types": types, "--from": first, "--conversation": conversation, "-o": output}
        try:
            pieces = _pieces(form, saved, selection, messages)
        except _TooManyError as many:
            others = _command(file, form, {**options, "--to": many.last})
            raise Failure(USAGE, f"{many}{f'; for the first messages: {others}' if many.last else ''}") from many
        if output is None:
            for piece in pieces:
                click.echo(piece, nl=False)
        else:
            _write(output, pieces, count=len(messages))


def _export_costs(saved: SavedTrace, file: Path, output: Path | None) -> None:
    """Write the improvements of the team's cost as CSV."""
    import csv
    import io

    from robochoc.journal.as_rows import cost_rows

    if not (found := cost_rows(saved.events())):
        why = "there are no costs: the run minimised nothing, found no assignment, or was killed"
        raise Failure(INVALID, _one_line(f"{file}: {why} (journals of DCOPs have costs)"))
    table = io.StringIO()
    writer = csv.DictWriter(table, found[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(found)
    if output is None:
        click.echo(table.getvalue(), nl=False)
    else:
        _write(output, [table.getvalue().encode()], count=len(found), unit="cost")


def _write(output: Path, pieces: Iterable[bytes], *, count: int, unit: str = "message") -> None:
    """Write an export of `count` messages or costs to a file, and print the file's size."""
    from robochoc.system.files import write_atomically

    size = 0

    def counted() -> Iterator[bytes]:
        nonlocal size
        for piece in pieces:
            size += len(piece)
            yield piece

    try:
        write_atomically(output, counted())
    except OSError as error:
        why = f"{output}: the export cannot be written: {error.strerror} (free some space, or name another file)"
        raise Failure(INVALID, _one_line(why)) from error
    click.echo(f"{output}: {count:,} {unit}{'s' * (count != 1)}, {size:,} bytes")


def _pieces(form: str, saved: SavedTrace, selection: Selection, messages: range | list[int]) -> Iterable[bytes]:
    """Return the export piece by piece."""
    from robochoc.journal.reader import text_lines
    from robochoc.sniffer.export import TooMuchToDrawError, acl_texts, drawable, in_words, mermaid, table
    from robochoc.sniffer.page_data import PageData
    from robochoc.sniffer.selection import excerpt_of

    trace, events = saved.trace, saved.events
    is_complete = len(messages) == len(trace.messages.t)
    match form:
        case "words":
            return in_words(PageData(trace), saved.journal(), messages)
        case "jsonl":
            chosen = events() if is_complete else excerpt_of(events(), trace, messages)
            return text_lines(trace.header, chosen, trace.outcome)
        case "acl":
            return acl_texts(PageData(trace), messages)
        case "csv":
            return table(PageData(trace), messages)
        case "mermaid":
            data = PageData(trace)
            try:
                return [mermaid(data, messages)]
            except TooMuchToDrawError as much:
                why = f"{much} (select fewer with --robots, --types, --from and --to)"
                raise _TooManyError(why, drawable(data, messages)) from much
        case _:
            return [_page(saved, selection)]


class _TooManyError(RobochocError):
    """There are too many messages for the format. `last`: the number of the last message that fits, or None."""

    def __init__(self, why: str, fitting: Sequence[int]) -> None:
        super().__init__(why)
        self.last = fitting[-1] if fitting else None


def _command(file: Path, form: str, options: Mapping[str, object]) -> str:
    """Return the same command with other `options`. Options without a value are left out."""
    given = [str(part) for name, value in options.items() if value not in (None, "", 0) for part in (name, value)]
    return shlex.join(["robochoc", "journal", "export", str(file), "--format", form, *given])


def _page(saved: SavedTrace, selection: Selection) -> bytes:
    """Return a page with the complete run, since causes and effects of messages are in other messages."""
    from robochoc.sniffer.selection import Selection

    trace = saved.trace
    if selection != replace(Selection(), robots=selection.robots):
        raise click.UsageError(
            "--format html exports all messages: remove --types, --from, --to and --run, and filter on the page"
        )
    count = len(trace.messages.t)
    if count > MOST_IN_PAGE:
        raise Failure(
            USAGE,
            f"{count:,} messages are too many for one page: at most {MOST_IN_PAGE:,}"
            " (use 'robochoc sniff', or export another format)",
        )
    from robochoc.sniffer.export import embedded_answers
    from robochoc.sniffer.page import sniffer_page
    from robochoc.sniffer.page_data import PageData
    from robochoc.sniffer.scene import complete_scene

    data = PageData(trace, chosen=selection.robots)
    answers = {**embedded_answers(data, saved.journal()), "scene": zlib.compress(complete_scene(trace))}
    return sniffer_page("embedded", answers, title=f"{trace.header.protocol} on {trace.header.team}")


def _one_line(words: str) -> str:
    from robochoc.formats import on_one_line

    return on_one_line(words)
