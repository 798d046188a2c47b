"""The core that needs nothing else (`pyproject.toml`): no module of its packages is forgotten in the contract."""

from __future__ import annotations

import tomllib

from tests.support.program import ROOT

APART = {
    "robochoc.communication.network",
    "robochoc.run.networked",
    # Filters are for messages on a network, and use its keys.
    "robochoc.communication.filters",
    "robochoc.communication.sealed",
    "robochoc.communication.signed",
}


def test_the_contract_lists_all_modules_of_communication_and_run() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (core,) = (contract for contract in contracts if contract["name"].startswith("The core"))
    listed = set(core["source_modules"])
    for package in ("communication", "run"):
        found = {
            f"robochoc.{package}.{path.stem}"
            for path in (ROOT / "robochoc" / package).iterdir()
            if not path.name.startswith("__")
        }
        assert found - APART == {name for name in listed if name.startswith(f"robochoc.{package}.")}
