"""Runs of a protocol in the simulator, on teams too large to be explored, judged in the same way.

Each run must end with a right answer, or at the limit of messages; it must be the same again with the same seed; and
each of its messages must have its sentence.
"""

from __future__ import annotations

import time
from dataclasses import replace

from robochoc.communication.host import message_decoder
from robochoc.communication.search_result import SearchResult
from robochoc.communication.simulator.schedule import Concurrent, RandomChannels, Schedule
from robochoc.communication.simulator.simulator import Simulation
from robochoc.exploration.check import Case
from robochoc.exploration.judgement import TeamJudge
from robochoc.model.outcome import Metrics, Verdict
from robochoc.protocols.message import Envelope
from robochoc.replay.run_names import run_names
from robochoc.system.time_limit import TimeLimitError, computed_by

MOST_MESSAGES = 3000
"""The maximum number of messages in a run: an incomplete protocol may continue forever."""
LONGEST_RUN_S = 60.0
"""The time after which a run that does not end is a fault, in seconds."""


def fault_in_simulation(case: Case, seed: int) -> str:
    """Return the fault in a simulated run, whose order of messages is drawn from `seed`; empty if there is none.

    Even seeds draw delays, odd ones the channel of the next message.
    """

    def schedule() -> Schedule:
        return RandomChannels(seed) if seed % 2 else Concurrent(seed, 10 * seed)

    spoken = _SpokenChannels(seed, case)
    try:
        results = [_result(case, one) for one in (schedule(), schedule())]
        _result(case, spoken)
    except TimeLimitError:
        return f"the run does not end within {LONGEST_RUN_S:g} seconds"
    except Exception as error:  # noqa: BLE001 - any error of a protocol is a fault that is reported
        return f"{type(error).__name__}: {error}"
    first, second = results
    if _facts(first) != _facts(second):
        return "two runs with the same seed differ; use no chance but Protocol.chance, and no order of a set of strings"
    is_cut = first.verdict == Verdict.UNKNOWN and sum(first.metrics.messages.values()) >= MOST_MESSAGES
    return TeamJudge(case.compiled, case.phase).fault_of_run(first, is_cut=is_cut) or spoken.fault


def _result(case: Case, schedule: Schedule) -> SearchResult:
    compiled, phase = case
    with Simulation(compiled, phase.protocol, schedule, parameters=phase.parameters) as simulation:
        return computed_by(time.monotonic() + LONGEST_RUN_S, simulation.search, messages=MOST_MESSAGES)


def _facts(result: SearchResult) -> object:
    """Return the part of a result that does not depend on the machine."""
    metrics: Metrics = replace(result.metrics, wall_s=0.0)
    return result.verdict, result.witness, result.assignments, metrics


class _SpokenChannels(RandomChannels):
    """Also requests each message's sentence. `fault`: why it fails; empty if none does."""

    def __init__(self, seed: int, case: Case) -> None:
        super().__init__(seed)
        self.fault = ""
        self._on_tree = case.phase.traits.tree
        self._names = run_names(case.compiled.team, on_tree=self._on_tree)
        self._decode = message_decoder(case.phase.protocol.messages).decode

    def put(self, envelope: Envelope, checks: int = 0) -> None:
        """See `Schedule.put`."""
        super().put(envelope, checks)
        message = self._decode(envelope.content)
        words = self._names.wording(envelope.sender, envelope.receiver, on_tree=self._on_tree)
        try:
            message.in_words(words)
        except Exception as error:  # noqa: BLE001 - any error of a protocol is a fault that is reported
            self.fault = self.fault or f"{type(message).__name__}.in_words: {type(error).__name__}: {error}"
