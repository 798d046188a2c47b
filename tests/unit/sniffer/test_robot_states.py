"""The states of a robot do not depend on the order in which their chunks are requested."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from robochoc.journal.journal import read_journal
from robochoc.replay import states_of
from robochoc.sniffer import robot_states
from robochoc.sniffer.growing_file import GrowingFile
from robochoc.sniffer.robot_states import RobotStates
from tests.support.examples import examples
from tests.support.sniffer_server import header, journal_of, run_events

CHUNK = 3
CONTENT = journal_of(*run_events(), header("simulator"))
ROBOTS = ("Robot1.1", "Robot2.2")
STATES = {robot: [*states_of(read_journal(CONTENT), robot)] for robot in ROBOTS}
_requests = st.tuples(st.sampled_from(ROBOTS), st.integers(0, 40))


@given(requests=st.lists(_requests, max_size=12), final=st.booleans())
@examples(20, also_suppress=(HealthCheck.function_scoped_fixture,))
def test_chunks_in_any_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, requests: list[tuple[str, int]], final: bool
) -> None:
    monkeypatch.setattr(robot_states, "STATES", CHUNK)
    path = tmp_path / "run.journal"
    path.write_bytes(CONTENT)
    with path.open("rb") as opened:
        file = GrowingFile(opened.fileno())
        file.widen(len(CONTENT))
        states = RobotStates()
        for robot, number in requests:
            expected = STATES[robot][number * CHUNK : (number + 1) * CHUNK]
            assert states.chunk(file, robot, number, final=final) == msgspec.json.encode(expected)


def test_a_growing_file_is_read_from_where_it_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robot_states, "STATES", CHUNK)
    path = tmp_path / "run.journal"
    path.write_bytes(CONTENT)
    robot, chunks = ROBOTS[0], -(-len(STATES[ROBOTS[0]]) // CHUNK)
    assert chunks > 1
    with path.open("rb") as opened:
        file = GrowingFile(opened.fileno())
        states = RobotStates()
        found: list[bytes] = []
        while file.widen(len(CONTENT) // 5):
            found = [states.chunk(file, robot, number, final=False) for number in range(chunks)]
        assert b"".join(found) == b"".join(
            msgspec.json.encode(STATES[robot][first : first + CHUNK]) for first in range(0, chunks * CHUNK, CHUNK)
        )
