"""Reports: one self-contained HTML page, or a folder of figures for a paper."""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Iterator
from pathlib import Path

from robochoc.experiments import summary
from robochoc.experiments.export import latex_table
from robochoc.experiments.figures import Drawing, figures_of, file_name, unique_names
from robochoc.experiments.html_page import page, table
from robochoc.experiments.report_content import PAIRS_EXPLANATION, ReportContent, headed
from robochoc.experiments.results import Results
from robochoc.experiments.summary import METRICS
from robochoc.formats.diagnostics import invalid_input
from robochoc.system.files import write_atomically


def write_page(results: Results, page: Path, over: str | None = None) -> None:
    """Write the report on the results of a study as one HTML file.

    Args:
        results: The results.
        page: The file to write.
        over: The parameter of tables and figures. None: the study's parameter, or the first one with several values.

    Raises:
        InvalidInputError: if there are no results, or the parameter does not exist.
        OSError: if the page cannot be written.
    """
    write_atomically(page, _Report(results, over).page().encode())


def write_folder(results: Results, folder: Path, over: str | None = None, *, replace: bool = False) -> None:
    """Write the report's figures (SVG and PDF), their captions, and its table (LaTeX) into `folder`.

    Raises:
        InvalidInputError: if there are no results, the parameter does not exist, or a figure already exists and
            `replace` is false.
        OSError: if the files cannot be written.
    """
    report = _Report(results, over)
    tables = unique_names([file_name("medians", part) for part, _ in report.parts])
    files = {
        f"{name}.tex": latex_table(rows, headed(report.title, part), report.over, report.metrics).encode()
        for name, (part, rows) in zip(tables, report.parts, strict=True)
    }
    captions = [*report.remarks, *(f"{one.name}: {one.title}. {one.caption}" for one in report.drawings)]
    files["captions.txt"] = "".join(f"{line}\n" for line in captions).encode()
    for drawing in report.drawings:
        files |= {f"{drawing.name}.svg": drawing.svg(), f"{drawing.name}.pdf": drawing.pdf()}
    there = [name for name in files if (folder / name).exists()]
    if there and not replace:
        raise invalid_input(folder / there[0], "already exists", "replace figures by --force")
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        write_atomically(folder / name, content)


class _Report(ReportContent):
    """The content of a report, including figures."""

    def __init__(self, results: Results, over: str | None) -> None:
        super().__init__(results, over)
        found = [(part, figures_of(rows, self.over, self.metrics, self.width)) for part, rows in self.parts]
        drawings = [_of_part(one, part) for part, figures in found for one in figures.drawings]
        names = unique_names([one.name for one in drawings])
        self.drawings = [dataclasses.replace(one, name=name) for one, name in zip(drawings, names, strict=True)]
        self.remarks = [f"{part}: {line}" if part else line for part, figures in found for line in figures.remarks]

    def page(self) -> str:
        """Return the HTML page."""
        return page(self.title, "\n".join(self._body()))

    def _body(self) -> Iterator[str]:
        yield from (f"<p>{html.escape(part)}</p>" for part in self.paragraphs)
        yield "".join(f"<p>{html.escape(line)}</p>" for line in self.measured())
        items = "".join(f"<li>{html.escape(line)}</li>" for line in self.answers())
        yield f"<ul>{items}</ul>" if items else ""
        yield "<h2>How runs ended</h2>" + table(*summary.endings(self.rows))
        yield "<h2>Figures</h2>"
        yield "".join(f"<p>{html.escape(line)}</p>" for line in self.remarks)
        yield '<div class="figures">'
        for drawing in self.drawings:
            caption = f"<b>{html.escape(drawing.title)}.</b> {html.escape(drawing.caption)}"
            yield f"<figure>{_inline(drawing)}<figcaption>{caption}</figcaption></figure>"
        yield "</div><h2>Medians</h2>"
        for part, rows in self.parts:
            for metric in self.metrics:
                head = html.escape(headed(METRICS[metric], part))
                yield f"<h3>{head}</h3>" + table(*summary.medians(rows, metric, self.over))
        yield from self._tests()
        yield "<h2>How to repeat it</h2>" + self._how_to_repeat()

    def _tests(self) -> Iterator[str]:
        for name, pairs in self.pairs():
            yield f"<h2>Pairs: {html.escape(name)}</h2>"
            yield f"<p>{PAIRS_EXPLANATION}</p>"
            yield table(*pairs)

    def _how_to_repeat(self) -> str:
        name = html.escape(f"{self.name}.toml")
        return (
            f"<p>Save this as {name}:</p><pre>{html.escape(self.text)}</pre>"
            f"<pre>robochoc experiment run {name}\n"
            f"robochoc experiment report {html.escape(self.name)}.sqlite -o report.html</pre>"
        )


def _of_part(drawing: Drawing, part: str) -> Drawing:
    if not part:
        return drawing
    return dataclasses.replace(drawing, name=file_name(drawing.name, part), title=headed(drawing.title, part))


def _inline(drawing: Drawing) -> str:
    """Return a figure as an element for the page, without the XML declaration and with unique identifiers."""
    svg = drawing.svg(text=True).decode()
    svg = svg[svg.index("<svg") :]
    for sign in ('id="', 'href="#', "url(#"):
        svg = svg.replace(sign, f"{sign}{drawing.name}-")
    label = html.escape(drawing.title)
    return svg.replace("<svg", f'<svg role="img" aria-label="{label}"', 1)
