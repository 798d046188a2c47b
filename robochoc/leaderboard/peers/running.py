"""Runs peers on instances of the benchmark set, each run in a process of its own, and checks their answers."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType

import msgspec

from robochoc.experiments.task import Status
from robochoc.formats.dialects.tabulation import owned_constraints
from robochoc.leaderboard.certificates import published
from robochoc.leaderboard.export import checked_team
from robochoc.leaderboard.instances import Instance
from robochoc.leaderboard.peers.claims import wrong_claim
from robochoc.leaderboard.peers.frodo import Frodo
from robochoc.leaderboard.peers.peer import Algorithm, Peer, PeerAnswer, PeerError, UnusablePeerError
from robochoc.leaderboard.peers.program import run_program
from robochoc.leaderboard.peers.propflow import Propflow
from robochoc.leaderboard.peers.pydcop import Pydcop
from robochoc.leaderboard.results import LARGEST_COUNT, PEER_SEPARATOR, Budget, Entrant, LeaderboardResults, RunResult
from robochoc.leaderboard.saved_runs import SavedRuns
from robochoc.model.constraint import ConstraintModel
from robochoc.model.outcome import Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.errors import UnsupportedError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.parallel_map import ParallelMap
from robochoc.system.plain_text import on_one_line
from robochoc.system.suggestions import did_you_mean
from robochoc.system.temporary_files import PrivateFolder
from robochoc.verification.checker import assignment_cost, violated_constraints

PEERS: Mapping[str, type[Peer]] = MappingProxyType({one.name: one for one in (Frodo, Pydcop, Propflow)})
GRACE_S = 15.0
"""The seconds beyond the time limit until a peer is killed: it starts, and reports its best answer."""


@dataclass(frozen=True)
class PeerEntrant:
    """An algorithm of a peer that takes part.

    Attributes:
        peer: The peer.
        algorithm: The algorithm.
        entrant: The entrant in the results.
    """

    peer: Peer
    algorithm: Algorithm
    entrant: Entrant


def peer_entrants(words: Sequence[str], places: Mapping[str, Path]) -> list[PeerEntrant]:
    """Return the peers' algorithms named by words, without repetitions.

    Args:
        words: Names such as `pydcop:dpop`.
        places: The paths of the peers' programs, by the names of the peers.

    Raises:
        UnusablePeerError: if a peer or an algorithm is unknown, or a program is missing or unusable.
    """
    for name in places:
        if name not in PEERS:
            raise UnusablePeerError(f"--peer: {did_you_mean(name, PEERS, f'the peers are {_listed(PEERS)}')}")
    found, peers = [], {}
    for word in dict.fromkeys(words):
        name, _, algorithm = word.partition(PEER_SEPARATOR)
        kind = PEERS[name]
        if algorithm not in kind.algorithms:
            hint = did_you_mean(algorithm, kind.algorithms, f"it has {_listed(kind.algorithms)}")
            raise UnusablePeerError(f"{kind.title} has no algorithm {algorithm!r}; {hint}")
        if name not in places:
            raise UnusablePeerError(f"{word} requires --peer {name}={kind.place_name}; {kind.install}")
        if name not in peers:
            peer = kind(places[name])
            peers[name] = peer, peer.version()
        peer, version = peers[name]
        found.append(PeerEntrant(peer, kind.algorithms[algorithm], Entrant(name=word, package=version)))
    return found


def _listed(names: Mapping[str, object]) -> str:
    return ", ".join(names)


def with_peers(
    results: LeaderboardResults,
    peers: Sequence[PeerEntrant],
    instances: Sequence[Instance],
    *,
    jobs: int = 1,
    times: bool = False,
    progress: Callable[[int, int], None] | None = None,
    saved: SavedRuns | None = None,
) -> LeaderboardResults:
    """Run each peer once on each instance, and return the results with these runs.

    Args:
        results: Results of protocols on the same instances. They may have no runs.
        peers: The peers.
        instances: The instances.
        jobs: The number of peers that run at the same time.
        times: True if processor times are recorded.
        progress: Called with the number of finished runs and of all runs.
        saved: Finished runs, which are not repeated. New runs are added.
    """
    saved = saved or SavedRuns()
    pairs = [(one, peer) for one in instances for peer in peers]
    missing = [pair for pair in pairs if (pair[0].name, pair[1].entrant.name) not in saved.found]
    before = len(pairs) - len(missing)
    show = progress and (lambda done, _: progress(before + done, len(pairs)))
    with PrivateFolder() as folder:
        function = partial(_run, folder=folder, budget=results.budget, times=times)
        with ParallelMap(function, jobs, show) as running:
            for _, run in running.results(missing):
                saved.add(run)
    found = saved.found | {(run.instance, run.protocol): run for run in results.runs}
    entrants = [*results.entrants, *(one.entrant for one in peers)]
    keys = [(instance.name, entrant.name) for instance in instances for entrant in entrants]
    runs = [found[key] for key in keys if key in found]
    return msgspec.structs.replace(results, entrants=entrants, runs=runs)


def _run(
    pair: tuple[Instance, PeerEntrant], _: Callable[[int], None], *, folder: Path, budget: Budget, times: bool
) -> RunResult:
    own = folder / f"{pair[0].name}-{pair[1].entrant.name.replace(PEER_SEPARATOR, '-')}"
    own.mkdir()
    try:
        return _run_in(own, *pair, budget, times=times)
    finally:
        shutil.rmtree(own, ignore_errors=True)


def _run_in(own: Path, instance: Instance, one: PeerEntrant, budget: Budget, *, times: bool) -> RunResult:
    blank = RunResult(instance=instance.name, protocol=one.entrant.name, status=Status.REFUSED)
    team = checked_team(instance)
    try:
        _refuse(team)
        command = one.peer.command(team, one.algorithm, own, budget.time_s)
    except UnsupportedError as refused:
        return msgspec.structs.replace(blank, reason=on_one_line(str(refused), 900))
    ended = run_program(command, own, budget.time_s + GRACE_S)
    blank = msgspec.structs.replace(blank, cpu_s=round(ended.cpu_s, 3) if times else None)
    try:
        answer = one.peer.answer(own, ended)
    except PeerError as wrong:
        late = ended.status is None
        reason = "killed at the time limit without an answer" if late else on_one_line(str(wrong), 900)
        return msgspec.structs.replace(blank, status=Status.LIMIT if late else Status.ERROR, reason=reason)
    return checked_run(blank, team, answer, one.algorithm)


def _refuse(team: Team) -> None:
    """Raise `UnsupportedError` for problems whose export would be another problem."""
    if team.scenario:
        raise UnsupportedError("peers solve problems that do not change")
    if any(one.constraint.model == ConstraintModel.PKC for one in owned_constraints(team)):
        raise UnsupportedError("peers would get the costs of both robots of an asymmetric constraint")


def checked_run(blank: RunResult, team: Team, answer: PeerAnswer, algorithm: Algorithm) -> RunResult:
    """Return a run with the answer of a peer: its cost is computed here, and the peer's statements are kept apart.

    Args:
        blank: The run without an answer.
        team: The problem.
        answer: The answer.
        algorithm: The algorithm.
    """
    has_ended = answer.is_finished or not algorithm.ends
    has_costs = team.kind != ProblemKind.DISCSP
    claimed, claimed_cost = _claim(answer, algorithm, has_costs=has_costs)
    best, fault = published()[blank.instance], _fault(team, answer)
    run = msgspec.structs.replace(
        blank,
        status=Status.ENDED if has_ended else Status.LIMIT,
        reason=fault or None,
        verdict=Verdict.UNKNOWN,
        messages=_valid_count(answer.messages),
        bytes=_valid_count(answer.bytes),
        ncccs=_valid_count(answer.ncccs),
        claimed_verdict=claimed,
        claimed_cost=claimed_cost,
    )
    if fault and claimed == Verdict.NO_SOLUTION == best.verdict:
        return msgspec.structs.replace(run, status=Status.DONE, reason=None, verdict=Verdict.NO_SOLUTION)
    if fault:
        return run
    assignment = {name: answer.assignment[name] for name in team.variables}
    cost = int(assignment_cost(team, assignment)) + sum(robot.costs.constant for robot in team.robots)
    run = msgspec.structs.replace(run, assignment=assignment, cost=cost if has_costs else None)
    if not has_ended:
        return run
    is_proof = claimed == Verdict.OPTIMAL and not wrong_claim(run, best)
    verdict = Verdict.OPTIMAL if is_proof else Verdict.SOLUTION
    return msgspec.structs.replace(run, status=Status.DONE, verdict=verdict)


def _valid_count(count: int | None) -> int | None:
    return count if count is not None and 0 <= count <= LARGEST_COUNT else None


def _fault(team: Team, answer: PeerAnswer) -> str:
    """Return the reason why an assignment is not valid; empty if it satisfies all hard constraints."""
    missing = [name for name, one in team.variables.items() if answer.assignment.get(name) not in one.domain]
    if missing:
        return f"{len(missing)} of {len(team.variables)} variables have no value in their domains: {missing[0]}, ..."
    found = violated_constraints(team, answer.assignment)
    return f"its assignment violates {found.number} of {found.hard} hard constraints" if found.number else ""


def _claim(answer: PeerAnswer, algorithm: Algorithm, *, has_costs: bool) -> tuple[str | None, float | None]:
    """Return the verdict and the cost that a peer states."""
    proves = algorithm.is_complete and answer.is_finished
    if answer.cost is None:
        return None, None
    if math.isinf(answer.cost):
        return (Verdict.NO_SOLUTION if proves else None), None
    if not has_costs:
        return Verdict.SOLUTION, None
    return (Verdict.OPTIMAL if proves else Verdict.SOLUTION), answer.cost
