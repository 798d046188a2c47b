"""A class as the protocol; journals, pages, progress; the end of a search by an event or a cancelled task."""

from __future__ import annotations

import asyncio
import threading
import time
from pathlib import Path
from typing import Any

import pytest

import robochoc
from robochoc.communication.search_result import Progress
from robochoc.journal import read_journal
from robochoc.journal.events import AnyEvent, Improved
from robochoc.protocols.local_search.mgm import MGM
from robochoc.run.registry import installed_protocols, protocol_names
from tests.support.cases import looped
from tests.support.limits import HANG_S


@pytest.fixture(autouse=True)
def _no_protocols_registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.run.registry.REGISTERED", {})


class SlowMGM(MGM):
    """A protocol of a notebook."""


def slots(robots: int = 4, values: int = 4) -> robochoc.Model:
    model = robochoc.Model("slots")
    chosen = [model.robot(f"r{i}").variable("x", range(values)) for i in range(robots)]
    model.add(robochoc.all_different(chosen))
    model.minimize(sum(abs(one - 2) for one in chosen))
    return model


def hard() -> robochoc.Model:
    """Return a problem that takes minutes."""
    model = robochoc.Model("hard")
    chosen = [model.robot(f"r{i}").variable("x", range(12)) for i in range(14)]
    model.minimize(sum(abs(a - b - 3) * 7 % 11 + a * b % 7 for a in chosen for b in chosen if a is not b))
    return model


@looped("runtime", ["simulator", "processes"])
def test_a_protocol_may_be_a_class(runtime: str) -> None:
    assert slots().solve(MGM, runtime).protocol == "mgm"
    outcome = slots().solve(SlowMGM, runtime)
    assert (outcome.protocol, outcome.verdict) == ("slowmgm", "solution")
    robochoc.register("own-mgm", SlowMGM)
    assert slots().solve("OWN-MGM", runtime).protocol in {"own-mgm", "slowmgm"}
    assert {"own-mgm", "slowmgm"} <= {*protocol_names()}
    assert "this program" in {one.package for one in installed_protocols()}


def test_programs_on_a_network_do_not_know_a_registered_protocol() -> None:
    with pytest.raises(robochoc.UnsupportedError, match="runtime='network' starts other programs, which do not know"):
        slots().solve(SlowMGM, "network")


@pytest.mark.parametrize(
    ("name", "protocol", "text"),
    [
        ("abt", SlowMGM, "installed protocol is called 'abt'"),
        ("central", SlowMGM, "is called 'central'"),
        ("a b", SlowMGM, "'a b' is not a valid name"),
        ("x", int, "int is not a subclass of Protocol"),
        ("x", 3, "3 is not a subclass of Protocol"),
    ],
)
def test_names_and_classes_that_cannot_be_registered(name: str, protocol: type[MGM], text: str) -> None:
    with pytest.raises(robochoc.OptionError, match=text):
        robochoc.register(name, protocol)
    assert "x" not in protocol_names()


def test_a_journal_a_page_and_progress(tmp_path: Path) -> None:
    events: list[AnyEvent] = []
    seen: list[Progress] = []
    journal, page = tmp_path / "run.journal", tmp_path / "run.html"
    outcome = slots().solve("mgm", journal=journal, html=str(page), observer=events.append, progress=seen.append)
    assert len([*robochoc.journal.rows(journal)]) >= len(events) > outcome.metrics.messages["Value"]
    assert b"<html" in page.read_bytes()[:1000]
    assert seen


def test_a_journal_of_a_problem_that_changes_weighs_no_decision_by_the_first_problem(tmp_path: Path) -> None:
    journal = tmp_path / "run.journal"
    slots().solve("dpop", journal=journal)
    assert any(isinstance(event, Improved) for event in read_journal(journal.read_bytes()).events)
    outcome = slots().solve("dpop", journal=journal, environment=lambda *_: None)
    assert outcome.verdict == "optimal"
    assert not any(isinstance(event, Improved) for event in read_journal(journal.read_bytes()).events)


def test_a_run_that_is_refused_keeps_the_older_journal(tmp_path: Path) -> None:
    journal = tmp_path / "run.journal"
    journal.write_text("older")
    with pytest.raises(robochoc.UnsupportedError):
        slots().solve("abt", journal=journal)
    assert journal.read_text() == "older"


@looped("runtime", ["simulator", "processes", "arrays"])
def test_an_event_ends_the_search_with_the_best_answer(runtime: str) -> None:
    stop = threading.Event()

    def stop_later(progress: Progress) -> None:
        if progress.messages > 300:
            stop.set()

    outcome = slots().solve("mgm", runtime, settings={"cycles": 10**8}, stop=stop, timeout=HANG_S, progress=stop_later)
    assert stop.is_set()
    assert outcome.metrics.wall_s < HANG_S
    assert outcome.assignment
    assert not slots().solve("mgm", settings={"cycles": 2}).reason  # the next run is not stopped


def test_a_cancelled_task_ends_its_search() -> None:
    async def cancelled() -> float:
        began = time.monotonic()
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(hard().solve_async("syncbb", timeout=HANG_S), 0.3)
        return time.monotonic() - began

    assert asyncio.run(cancelled()) < HANG_S
    assert asyncio.run(slots().solve_async("mgm")).verdict == "solution"


@looped(("withdraw", "number"), [(True, 1), ("minimum", 1), (False, 0), (None, 0)])
def test_withdraw_may_be_true(withdraw: Any, number: int) -> None:  # noqa: ANN401
    outcome = slots(4, 3).solve(withdraw=withdraw)
    assert len(outcome.withdrawn) == number
