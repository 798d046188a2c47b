"""`robochoc compare`: compares protocols side by side, without a study file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.paths import OutputFile
from robochoc.cli.options.sections import COMMON, SectionedCommand, Sections
from robochoc.cli.options.solve import objectives_option
from robochoc.cli.options.value_types import Number, WholeNumber
from robochoc.cli.reports.failures import invalid_input_fails

if TYPE_CHECKING:
    from collections.abc import Sequence

    from robochoc.experiments.study import Study

DEFAULT_SEEDS = "1..10"
_SECTIONS: Sections = {
    COMMON: ("--protocols", "--set", "--timeout", "--jobs", "--help"),
    "Problem and runs": ("--objectives", "--order", "--runtime", "--schedule", "--channel"),
    "Results": ("--over", "--html", "--save"),
}


@click.command(
    cls=SectionedCommand, sections=_SECTIONS, short_help="Compare protocols on problems: a table and a picture."
)
@click.argument("problem", nargs=-1, required=True, metavar="PATH ...|FAMILY [NAME=VALUE ...]")
@click.option("--protocols", required=True, metavar="NAME,NAME,...", help="The protocols.")
@click.option(
    "--set", "settings", multiple=True, metavar="NAME=VALUE", help="Set a parameter of all protocols. Repeatable."
)
@click.option("--order", metavar="NAME", help="Priority order of the robots, or several, separated by commas.")
@click.option("--runtime", default="simulator", show_default=True, metavar="NAME", help="simulator, arrays, processes.")
@click.option("--schedule", metavar="NAME", help="Schedule of the simulator: concurrent, one-by-one, cycles, random.")
@click.option("--channel", metavar="NAME", help="Channel model of the simulator: wlan, wpan, wman, wwan.")
@objectives_option
@click.option(
    "--timeout", type=Number(0, min_open=True), default=30, show_default=True, metavar="SECONDS",
    help="Time limit of each run.",
)  # fmt: skip
@click.option(
    "--over", metavar="PARAMETER", help="Parameter whose values are the rows.  [default: the first with several values]"
)
@click.option("--html", type=OutputFile(), metavar="FILE", help="Write a page with figures and tests.")
@click.option(
    "--save", type=OutputFile(), metavar="FILE", help="Save the results in an SQLite file, for 'robochoc experiment'."
)
@click.option("--jobs", type=WholeNumber(1, 1024), metavar="N", help="Number of workers.  [default: one per processor]")
@invalid_input_fails
def compare(
    problem: tuple[str, ...],
    *,
    over: str | None,
    html: Path | None,
    save: Path | None,
    jobs: int | None,
    **runs: Any,  # noqa: ANN401 - the other options
) -> None:
    """Run protocols on the same problems, and show medians side by side.

    The problems are folders and files, or a family of 'robochoc generate' with its parameters as NAME=VALUE. A range
    such as 1..30 or 0.2..0.6:0.1 means each of its values.

    \b
    robochoc compare instances/queens3d-4 --protocols abt,afc-ng,dynabt
    robochoc compare random agents=15 domain=5 density=0.4 tightness=0.2..0.6:0.1 seed=1..30 \\
        --protocols abt,afc-ng,dynabt,awc --html compare.html
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    if html is not None:
        from robochoc.cli.commands.experiment import require_figures

        require_figures()
    from robochoc.cli.commands.experiment import carry_out, open_store
    from robochoc.cli.reports.experiment import print_tables

    study = _study(problem, over, runs)
    with open_store(save) as store:
        carry_out(study, store, jobs)
        results = store.results()
    print_tables(results, over, ())
    if html is not None:
        from robochoc.experiments.report import write_page

        write_page(results, html, over)
        click.echo(f"{html}: written", err=True)


def _study(problem: Sequence[str], over: str | None, runs: dict[str, Any]) -> Study:
    """Return the study described by the command line."""
    from robochoc.experiments.study import study_of_tables
    from robochoc.formats.diagnostics import shortened
    from robochoc.system.plain_text import on_one_line

    protocols = [name for name in runs.pop("protocols").split(",") if name]
    if not protocols:
        raise click.UsageError("--protocols is empty; give names, such as --protocols abt,afc-ng")
    settings = dict(_pair(word, "--set") for word in runs.pop("settings"))
    order = runs.pop("order")
    timeout = runs.pop("timeout")
    objectives = runs.pop("objectives")
    table: dict[str, Any] = {
        "protocol": protocols,
        **{name: value for name, value in runs.items() if value is not None},
    }
    table |= {"order": order.split(",")} if order else {}
    table |= {"settings": settings} if settings else {}
    table |= {"objectives": str(objectives)} if objectives else {}
    report = {"over": over} if over else {}
    title = on_one_line(shortened(f"{', '.join(protocols)} on {' '.join(Path(word).name for word in problem)}"))
    tables = {
        "title": title,
        "problems": _problems(problem),
        "runs": table,
        "limits": {"timeout": timeout},
        "report": report,
    }
    return study_of_tables("compare", tables)


def _problems(words: Sequence[str]) -> dict[str, Any]:
    """Return the table `[problems]`: a family and its parameters, or paths."""
    from robochoc.generators.families import FAMILIES, parameters_of

    first = words[0]
    if first in FAMILIES and not Path(first).exists():
        given = dict(_pair(word, first) for word in words[1:])
        if "seed" in parameters_of(first):
            given.setdefault("seed", DEFAULT_SEEDS)
        return {"family": first, **given}
    missing = [word for word in words if not Path(word).exists()]
    if missing:
        import difflib

        near = difflib.get_close_matches(missing[0], FAMILIES, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"families are {', '.join(FAMILIES)}"
        raise click.UsageError(f"{missing[0]!r} is not a folder, a file or a family; {hint}")
    return {"path": [str(Path(word).absolute()) for word in words]}


def _pair(word: str, option: str) -> tuple[str, Any]:
    """Parse NAME=VALUE for `option`, or for the family with this name, whose parameters may be written with hyphens."""
    name, equals, value = word.partition("=")
    if not equals or not name:
        raise click.UsageError(f"{option} requires NAME=VALUE, not {word!r}")
    return name.replace("-", "_") if option != "--set" else name, _value(value)


def _value(text: str) -> Any:  # noqa: ANN401 - a number, a word, or a list
    """Parse a value. A text with commas is a list of values."""
    if "," in text:
        return [_value(part) for part in text.split(",") if part]
    if text in {"true", "false"}:
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
