"""What `robochoc protocols` tells: a row a protocol, for people or for machines."""

from __future__ import annotations

import inspect
import shutil
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import msgspec
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from robochoc import __version__
from robochoc.formats import on_one_line
from robochoc.protocols.protocol import NO_SETTINGS, Settings
from robochoc.protocols.traits import Traits
from robochoc.run.options import CENTRAL
from robochoc.run.registry import Offer, offers
from robochoc.solver import central

WIDE = 150
"""A terminal of fewer columns is not told of papers and privacy: their words would be broken into pieces."""
UNBROKEN = 1000
"""Where no terminal reads it, a protocol has a line of its own."""
_KEYS = {"shared_scopes": "everywhere", "writes_to_non_neighbours": "beyond"}
"""Traits whose keys in `--json` keep their first names."""


@dataclass(frozen=True)
class Row:
    """One protocol, or the judge, which is none. `traits` is None where it is `broken`."""

    name: str
    place: str
    package: str
    traits: Traits | None
    broken: str = ""
    module: str = ""
    """Where its docstring stands."""
    settings: Settings = NO_SETTINGS
    """What can be set of it, with the defaults."""


def rows() -> list[Row]:
    """All that `robochoc solve --protocol` takes, and what it cannot take, with the reason."""
    return [*map(_row, offers()), _judge()]


def json_report(found: Sequence[Row], *, explain: bool = False) -> bytes:
    """A line each: one JSON object. `explain` adds the docstring."""
    encode = msgspec.json.Encoder().encode
    return b"".join(encode(_object(row, explain=explain)) + b"\n" for row in found)


def print_table(found: Sequence[Row]) -> None:
    """The table, on standard output, and below it what is wrong with what is broken."""
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else UNBROKEN
    console = Console(width=columns, highlight=False, soft_wrap=True)
    console.print(_table(found, wide=columns >= WIDE))
    for row in found:
        if row.broken:
            console.print(on_one_line(f"{row.name}: {row.place} (package {row.package}) {row.broken}"), markup=False)
    if columns < WIDE:
        console.print("the paper and what stays private: robochoc protocols NAME, or a wider terminal", markup=False)
    console.print("next: robochoc protocols NAME explains one; robochoc solve TEAM --protocol NAME", markup=False)


def explained(row: Row) -> str:
    """What the protocol is in a line, where it comes from, and what its author says of it."""
    head = f"{row.name}: {_in_a_line(row.traits)}" if row.traits else row.name
    place = f"{row.place}, from the package {row.package}"
    return f"{head}\n{place}\n{_settings(row)}\n{_docstring(row) or 'Its module has no docstring.'}"


def _settings(row: Row) -> str:
    """What can be set, each with its default, and what it means; empty where there is nothing."""
    there = msgspec.structs.asdict(row.settings)
    if not there:
        return ""
    defaults = "  ".join(f"{name}={value}" for name, value in there.items())
    meaning = inspect.cleandoc(type(row.settings).__doc__ or "")
    return f"--set {defaults}\n\n{meaning}\n"


def _in_a_line(traits: Traits) -> str:
    words = [
        "minimises costs" if traits.costs else "satisfaction",
        "complete" if traits.complete else "incomplete",
        "one robot acts at a time" if traits.synchronous else "robots act at the same time",
        "constraints between any number of robots" if traits.n_ary else "constraints between two robots",
        *(["partially known ones too"] if traits.partially_known else []),
        *(["goes on when the problem changes"] if traits.dynamic else []),
        *([f"keeps private: {traits.privacy}"] if traits.privacy else []),
        *([traits.paper] if traits.paper else []),
    ]
    return "; ".join(words)


def _row(offer: Offer) -> Row:
    if offer.protocol is None:
        return Row(offer.name, offer.place, offer.package, None, offer.broken)
    protocol = offer.protocol
    return Row(
        offer.name,
        offer.place,
        offer.package,
        protocol.traits,
        module=protocol.__module__,
        settings=protocol.settings,
    )


def _judge() -> Row:
    """The central judge, with the traits that a protocol of its powers would have."""
    traits = Traits(paper="no protocol: ACE decides all files merged", costs=True, partially_known=True, privacy="none")
    return Row(
        CENTRAL,
        f"{central.CentralSolver.__module__}:CentralSolver",
        f"robochoc {__version__}",
        traits,
        module=central.__name__,
    )


def _object(row: Row, *, explain: bool) -> dict[str, object]:
    traits = {_KEYS.get(name, name): value for name, value in asdict(row.traits).items()} if row.traits else {}
    known = {"name": row.name, "place": row.place, "package": row.package, "distributed": row.name != CENTRAL, **traits}
    known["settings"] = msgspec.structs.asdict(row.settings)
    if row.broken:
        known["broken"] = row.broken
    if explain:
        known["doc"] = _docstring(row)
    return known


def _docstring(row: Row) -> str:
    """Of its module; empty where there is none."""
    module = sys.modules.get(row.module)
    return inspect.cleandoc(module.__doc__ or "") if module else ""


def _table(found: Sequence[Row], *, wide: bool) -> Table:
    table = Table(box=None, header_style="bold")
    headings = ("name", "for", "complete", "synchronous", "constraints", "dynamic")
    for heading in headings:
        table.add_column(heading, no_wrap=True)
    if wide:
        table.add_column("paper")
        table.add_column("privacy")
    for row in found:
        cells = [on_one_line(row.name), *_cells(row)]
        table.add_row(*map(escape, cells if wide else cells[: len(headings)]))
    return table


def _cells(row: Row) -> list[str]:
    traits = row.traits
    if traits is None:
        return ["broken: see below", *["-"] * 4, "", ""]
    constraints = ("n-ary" if traits.n_ary else "binary") + (", PKC" if traits.partially_known else "")
    return [
        "optimisation" if traits.costs else "satisfaction",
        _yes(said=traits.complete),
        "-" if row.name == CENTRAL else _yes(said=traits.synchronous),
        constraints,
        _yes(said=traits.dynamic),
        on_one_line(traits.paper),
        on_one_line(traits.privacy),
    ]


def _yes(*, said: bool) -> str:
    return "yes" if said else "no"
