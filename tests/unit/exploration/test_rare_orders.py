"""`robochoc check` finds faults that few orders of messages show: those of `docs/explanation/rare-orders.md`."""

from __future__ import annotations

import pytest

from tests.support.changed_protocols import SourceChange, changed_protocol, random_faults
from tests.support.compiled import plain_python_only
from tests.support.program import ROOT
from tests.support.rare_faults import FAULTS, RUNS, RareFault

FEW = 500
"""The states of the cheap ones."""
RARE = RUNS // 5


@plain_python_only
@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(fault, id=fault.name, marks=pytest.mark.slow if fault.found.states > FEW else ())
        for fault in FAULTS
    ],
)
def test_a_fault_in_rare_orders_is_found(fault: RareFault) -> None:
    explored = fault.explored()
    assert explored.fault
    assert len(explored.path) <= fault.found.steps
    assert explored.states <= fault.found.states


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])
def test_few_random_runs_show_the_fault(fault: RareFault) -> None:
    assert random_faults(fault.case()[0], RUNS) <= RARE


def test_the_page_has_the_faults() -> None:
    page = (ROOT / "docs" / "explanation" / "rare-orders.md").read_text()
    assert [line for line in page.splitlines() if line.startswith("| `")] == [
        fault.row(fault.found) for fault in FAULTS
    ]
    assert len(FAULTS) == 20
    assert all(fault.found.runs <= RARE for fault in FAULTS)


def test_a_change_of_a_text_that_is_not_in_the_source_is_an_error() -> None:
    path = "robochoc/protocols/satisfaction/abt.py"
    with pytest.raises(ValueError, match=r"contains this text 0 times instead of once: 'nothing like this'"):
        changed_protocol("abt", SourceChange(path, "nothing like this", ""))
    with pytest.raises(ValueError, match="afc does not use"):
        changed_protocol("afc", SourceChange(path, "class ABT(Backtracking)", "class ABT(  Backtracking)"))


def test_a_changed_base_changes_the_protocol_and_no_other() -> None:
    change = SourceChange(
        "robochoc/protocols/satisfaction/nogood.py", "    if value == other:", "    if value != other:"
    )
    changed = changed_protocol("dynabt", change)
    assert changed is not changed_protocol("dynabt", change)
    assert {kind.__name__: kind.__module__ for kind in changed.__mro__}["ABT"].endswith("satisfaction.abt")
    names = {id(kind) for kind in changed_protocol("abt", change).__mro__}
    assert not names & {id(kind) for kind in changed.__mro__ if kind.__name__ in {"ABT", "Backtracking"}}
