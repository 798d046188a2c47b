"""The real loops of masters and robots around the votes, with killed, stopped and cut off machines at any moment.

Frames arrive late, or twice; in some runs, some never arrive. Each run must end without two different decisions.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from unittest.mock import patch

import pytest

from robochoc.communication.network.framing import MASTER
from robochoc.communication.network.leadership import Leadership
from robochoc.communication.network.master_votes import MasterVotes
from robochoc.model.problem import Constraint
from tests.support.examples import drawn
from tests.support.problems import PREDICATES, team_of
from tests.support.virtual_masters import MasterFault, World, faults_of, virtual_world

TEAM = team_of(
    dict.fromkeys("ABC", range(1, 5)),
    [Constraint("C", PREDICATES[0], pair, pair) for pair in itertools.combinations("ABC", 2)],
)
MACHINES = (MASTER, "B", "C", *TEAM.order)
SEEDS = 8


def played(seed: int, faults: tuple[MasterFault, ...], folder: Path, loss: float = 0.0) -> World:
    folder.mkdir()
    with virtual_world(TEAM, seed, folder, loss) as world:
        world.play(faults)
    return world


def found_in(number: int, name: str, folder: Path, loss: float = 0.0) -> dict[int, tuple[str, object]]:
    """Return the broken promises in `number` drawn runs, and the faults that led to them."""
    chance = drawn(name)
    found: dict[int, tuple[str, object]] = {}
    for _ in range(number):
        seed = chance.randrange(2**32)
        faults = faults_of(chance, MACHINES)
        world = played(seed, faults, folder / str(seed), loss)
        if world.fault:
            found[seed] = world.fault, faults
    return found


def test_without_faults_the_first_master_decides(tmp_path: Path) -> None:
    world = played(0, (), tmp_path / "run")
    assert (world.fault, list(world.published)) == ("", [MASTER])
    assert {ending.why for ending in world.endings.values()} == {"solution"}


def test_faults_at_any_moment_lead_to_no_two_decisions(tmp_path: Path) -> None:
    assert found_in(SEEDS, "faults of masters", tmp_path) == {}


@pytest.mark.more
def test_more_faults_lead_to_no_two_decisions(tmp_path: Path) -> None:
    assert found_in(10 * SEEDS, "more faults of masters", tmp_path) == {}


@pytest.mark.more
def test_lost_frames_lead_to_no_two_decisions(tmp_path: Path) -> None:
    assert found_in(SEEDS, "lost frames of masters", tmp_path, loss=0.01) == {}


@pytest.mark.parametrize("limits", [{"timeout": 10.0}, {"messages": 500}])
def test_limits_include_what_was_spent_under_earlier_masters(limits: dict[str, float], tmp_path: Path) -> None:
    with virtual_world(TEAM, 0, tmp_path) as world:
        world.changed = {**limits, "settings": {"cycles": "1000000"}}
        world.play((MasterFault(9.0, "kill", MASTER, 0),))
    spent = world.published["B"].metrics
    assert (sum(spent.messages.values()) < 400) if "messages" in limits else (spent.wall_s < 5)


def stopped_at(moment: str, folder: Path, seed: int, *planted: tuple[type, str, object]) -> World:
    """Play a run whose first master is stopped when it calls `moment`, until another one has decided."""
    called: Callable[..., object] = getattr(MasterVotes, moment)
    folder.mkdir()
    with ExitStack() as patches, virtual_world(TEAM, seed, folder) as world:
        for owner, name, value in planted:
            patches.enter_context(patch.object(owner, name, value))
            called = getattr(MasterVotes, moment)

        def stopping(self: MasterVotes, *arguments: object) -> object:
            if self.name == MASTER:
                world.stopped[MASTER] = world.now() + 30
                world.current.wait(0)
            return called(self, *arguments)

        patches.enter_context(patch.object(MasterVotes, moment, stopping))
        world.play((MasterFault(40, "stop", "C", 0),))
    return world


def test_a_master_that_is_stopped_before_it_proposes_does_not_publish(tmp_path: Path) -> None:
    world = stopped_at("propose", tmp_path / "run", 1)
    assert (world.fault, list(world.published)) == ("", ["B"])
    assert MASTER in world.reasons


def test_a_master_that_is_stopped_before_it_publishes_publishes_the_same(tmp_path: Path) -> None:
    world = stopped_at("check_acceptances", tmp_path / "run", 1)
    assert (world.fault, list(world.published)) == ("", ["B", MASTER])


NOTHING = (MasterVotes, "check_acceptances", lambda _self: None), (MasterVotes, "check_majority", lambda *_given: None)


@pytest.mark.parametrize(
    ("moment", "planted"),
    [
        ("propose", NOTHING),
        ("check_acceptances", [(Leadership, "inherited", property(lambda _self: None))]),
    ],
)
def test_planted_faults_are_found(moment: str, planted: list[tuple[type, str, object]], tmp_path: Path) -> None:
    found = [stopped_at(moment, tmp_path / str(seed), seed, *planted).fault for seed in range(4)]
    assert any(fault.startswith("two decisions") for fault in found), found
