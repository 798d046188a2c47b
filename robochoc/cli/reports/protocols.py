"""The report of `robochoc protocols`: the installed protocols as a table, as text, or as JSON."""

from __future__ import annotations

import inspect
import shutil
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import asdict, replace

import click
import msgspec

from robochoc import __version__
from robochoc.cli.reports.table import print_table
from robochoc.formats import on_one_line
from robochoc.protocols.settings import NO_SETTINGS, Settings
from robochoc.protocols.traits import Traits
from robochoc.run.defaults import CENTRAL
from robochoc.run.purposes import PURPOSES, purposes_of
from robochoc.run.registry import InstalledProtocol, installed_protocols
from robochoc.solver import central
from robochoc.system.compiled_core import docstring
from robochoc.system.lazy_dataclass import dataclass

_KEYS = {"shared_scopes": "everywhere", "writes_to_non_neighbours": "beyond"}
"""Traits whose key in `--json` is their name in the first version."""


@dataclass(frozen=True)
class ProtocolRow:
    """One protocol, or the central solver. `traits` is None if the protocol is `broken`."""

    name: str
    place: str
    package: str
    traits: Traits | None
    broken: str = ""
    module: str = ""
    """The module with the protocol's docstring."""
    settings: Settings = NO_SETTINGS
    """The protocol's settings, with the defaults."""

    @property
    def purposes(self) -> tuple[str, ...]:
        """Return the purposes implied by the protocol's traits; empty if the protocol is broken."""
        return purposes_of(self.traits) if self.traits else ()


def rows() -> list[ProtocolRow]:
    """Return all protocols that `robochoc solve --protocol` accepts, and the broken protocols with their errors."""
    return [*map(_row, installed_protocols()), _central_solver()]


def protocols_json(found: Sequence[ProtocolRow], *, explain: bool = False) -> bytes:
    """Return one JSON object per line. `explain` adds the docstring."""
    encode = msgspec.json.Encoder().encode
    return b"".join(encode(_object(row, explain=explain)) + b"\n" for row in found)


def print_protocols(found: Sequence[ProtocolRow], *, long: bool = False) -> None:
    """Print each protocol's name, purpose, completeness and use (`long`: all traits), then the broken protocols."""
    headings = ["name", "for", "complete", "use when"]
    if long:
        headings = [
            "name",
            "for",
            "complete",
            "synchronous",
            "constraints",
            "dynamic",
            "arrays",
            "lossy",
            "privacy",
            "paper",
        ]
    print_table(headings, [[row.name, *_cells(row, headings[1:])] for row in found], prose=headings[-1])
    for row in found:
        if row.broken:
            click.echo(on_one_line(f"{row.name}: {row.place} (package {row.package}) {row.broken}"))
    if not long and sys.stdout.isatty():
        click.echo("next: robochoc protocols NAME explains a protocol, 'auto' the choice; --long shows more columns")


def print_purposes(found: Sequence[ProtocolRow]) -> None:
    """Print each purpose with its description and the names of its protocols."""
    for name, purpose in PURPOSES.items():
        click.echo(f"{name}: {purpose.description}")
        names = ", ".join(row.name for row in found if name in row.purposes)
        for line in textwrap.wrap(names, min(shutil.get_terminal_size().columns, 100) - 2, break_on_hyphens=False):
            click.echo(f"  {line}")


def protocol_text(row: ProtocolRow) -> str:
    """Return the protocol's traits, module, parameters, and docstring without examples."""
    head = f"{row.name}: {_in_a_line(row.traits)}" if row.traits else row.name
    place = f"{row.place}, from the package {row.package}"
    about = _docstring(row).partition("\n>>> ")[0].rstrip()
    return f"{head}\n{place}\n{_settings(row)}\n{about or 'The module has no docstring.'}"


def _settings(row: ProtocolRow) -> str:
    """Return the parameters with their defaults and descriptions; empty if there are none."""
    settings = msgspec.structs.asdict(row.settings)
    if not settings:
        return ""
    defaults = "  ".join(f"{name}={value}" for name, value in settings.items())
    meaning = inspect.cleandoc(type(row.settings).__doc__ or "")
    return f"--set {defaults}\n\n{meaning}\n"


def _in_a_line(traits: Traits) -> str:
    words = [
        "minimises costs" if traits.costs else "satisfaction",
        "complete" if traits.complete else "incomplete",
        *(["can begin with a known upper bound of the cost"] if traits.upper_bound else []),
        "one robot acts at a time" if traits.synchronous else "robots act at the same time",
        "constraints between any number of robots" if traits.n_ary else "constraints between two robots",
        *(["also partially known constraints"] if traits.partially_known else []),
        *(["also asymmetric costs"] if traits.asymmetric else []),
        *(["continues when the problem changes"] if traits.dynamic else []),
        *(["also as arrays (--runtime arrays)"] if traits.arrays else []),
        *(["real numbers anywhere in their intervals"] if traits.continuous else []),
        *(["task allocations only"] if traits.allocates else []),
        *(["tolerates lost messages"] if traits.bears_loss else []),
        *([f"use when: {traits.use_when}"] if traits.use_when else []),
        *([f"keeps private: {traits.privacy}"] if traits.privacy else []),
        *([f"paper: {traits.paper}"] if traits.paper else []),
    ]
    return "; ".join(words)


def _row(offer: InstalledProtocol) -> ProtocolRow:
    if offer.protocol is None:
        return ProtocolRow(offer.name, offer.place, offer.package, None, offer.broken)
    protocol = offer.protocol
    traits = protocol.traits
    if traits.arrays and "traits" not in vars(protocol):  # inherited: the form as arrays is that of the base class
        traits = replace(traits, arrays=False)
    return ProtocolRow(
        offer.name,
        offer.place,
        offer.package,
        traits,
        module=protocol.__module__,
        settings=protocol.settings,
    )


def _central_solver() -> ProtocolRow:
    """Return the row for the central solver, with the traits of an equivalent protocol."""
    traits = Traits(
        paper="not a protocol: ACE solves all files merged",
        costs=True,
        partially_known=True,
        asymmetric=True,
        privacy="none",
        use_when="to check an answer or count solutions, without robots",
    )
    return ProtocolRow(
        CENTRAL,
        f"{central.CentralSolver.__module__}:CentralSolver",
        f"robochoc {__version__}",
        traits,
        module=central.__name__,
    )


def _object(row: ProtocolRow, *, explain: bool) -> dict[str, object]:
    traits = {_KEYS.get(name, name): value for name, value in asdict(row.traits).items()} if row.traits else {}
    known = {"name": row.name, "place": row.place, "package": row.package, "distributed": row.name != CENTRAL, **traits}
    known["purposes"] = row.purposes
    known["settings"] = msgspec.structs.asdict(row.settings)
    if row.broken:
        known["broken"] = row.broken
    if explain:
        known["doc"] = _docstring(row)
    return known


def _docstring(row: ProtocolRow) -> str:
    """Return the docstring of the protocol's module; empty if there is none."""
    module = sys.modules.get(row.module)
    return inspect.cleandoc(docstring(module)) if module else ""


def _cells(row: ProtocolRow, headings: Sequence[str]) -> list[str]:
    traits = row.traits
    if traits is None:
        return ["broken", *("-" for _ in headings[1:])]
    cells = {
        "for": "optimisation" if traits.costs else "satisfaction",
        "complete": _yes(holds=traits.complete),
        "synchronous": "-" if row.name == CENTRAL else _yes(holds=traits.synchronous),
        "constraints": ("n-ary" if traits.n_ary else "binary") + (", PKC" if traits.partially_known else ""),
        "dynamic": _yes(holds=traits.dynamic),
        "arrays": _yes(holds=traits.arrays),
        "lossy": _yes(holds=traits.bears_loss),
        "privacy": traits.privacy,
        "paper": traits.paper,
        "use when": traits.use_when,
    }
    return [cells[heading] for heading in headings]


def _yes(*, holds: bool) -> str:
    return "yes" if holds else "no"
