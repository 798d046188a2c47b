"""The published list of the benchmark set: the digest of each instance, and its answer with the solvers that proved it.

`python -m robochoc.leaderboard.certificates FILE` computes the list again (`make benchmark-set`). The two solvers of an
instance share no code: one finds the answer, and the other one proves the same verdict and cost.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec

from robochoc.experiments.digests import sha256_of_team
from robochoc.leaderboard.instances import DPOP, SET_VERSION, Instance, instances
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.run.defaults import CENTRAL
from robochoc.run.options import CentralSolverName, Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.system.errors import RobochocError
from robochoc.system.files import write_atomically
from robochoc.system.parallel_map import ParallelMap
from robochoc.system.posix import usable_processors

LIST_FILE = "instances.json"
TIMEOUT_S = 600.0
"""The time limit of a solver for one instance; all instances were chosen so that they take much less."""


class DisputedInstanceError(RobochocError):
    """The two solvers of an instance disagree, or one of them proved nothing."""


class Certificate(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An instance in the published list.

    Attributes:
        name: The name of the instance.
        family: Its family.
        size: Its size.
        generator: The family of `robochoc generate`.
        parameters: The parameters of the generator, with the seed.
        scenario: The parameters of `robochoc generate scenario`. Empty: the problem does not change.
        sha256: The SHA-256 of the team's canonical form, which are the contents of its files.
        robots: The number of robots at the start.
        verdict: The verdict: `optimal`, or `solution` or `no-solution` without costs. Of problems that change: of the
            last epoch.
        cost: The optimal cost, or the best known one.
        bound: The proven bound of the cost, which equals the cost of an optimum.
        proved_by: The solver that proved the answer.
        agreed_by: The second solver, which proved the same.
    """

    name: str
    family: str
    size: str
    generator: str
    parameters: dict[str, str | int | float | bool]
    scenario: dict[str, Any]
    sha256: str
    robots: int
    verdict: str
    cost: int | None
    bound: int | None
    proved_by: str
    agreed_by: str


class _Published(msgspec.Struct, frozen=True, kw_only=True):
    """The content of the list's file."""

    version: int
    instances: list[Certificate]


@cache
def published() -> Mapping[str, Certificate]:
    """Return the published certificates by the names of their instances."""
    content = files(__package__).joinpath(LIST_FILE).read_bytes()
    return {one.name: one for one in msgspec.json.decode(content, type=_Published).instances}


def certify(instance: Instance) -> Certificate:
    """Return the certificate of an instance, computed by both solvers.

    Raises:
        DisputedInstanceError: if the solvers disagree, or one of them proved nothing.
    """
    team = instance.team()
    problem = instance.problem
    first, second = instance.group.solvers
    verdict, cost = _answer(team, first)
    if (verdict, cost) != (again := _answer(team, second)) or verdict == Verdict.UNKNOWN:
        raise DisputedInstanceError(f"{instance.name}: {first} answers {verdict} {cost}, but {second} {again}")
    return Certificate(
        name=instance.name,
        family=instance.family,
        size=instance.size,
        generator=problem.family,
        parameters=problem.parameters,
        scenario=problem.scenario,
        sha256=sha256_of_team(team),
        robots=len(team.robots),
        verdict=verdict,
        cost=cost,
        bound=cost,
        proved_by=first,
        agreed_by=second,
    )


def _answer(team: Team, solver: str) -> tuple[str, int | None]:
    if solver == DPOP:
        options = Options(protocol=DPOP, runtime=Runtime.SIMULATOR, timeout=TIMEOUT_S)
    else:
        options = Options(protocol=CENTRAL, central_with=CentralSolverName(solver), timeout=TIMEOUT_S, cache=False)
    return answer_of(solve(team, options))


def answer_of(outcome: Outcome) -> tuple[str, int | None]:
    """Return the verdict, and the cost of an optimum. All costs of the set are integers."""
    proven = outcome.verdict == Verdict.OPTIMAL and outcome.cost is not None
    return str(outcome.verdict), int(outcome.cost or 0) if proven else None


def list_content(certificates: Iterable[Certificate]) -> bytes:
    """Return the content of the list's file, with one line for each instance."""
    lines = [msgspec.json.encode(one).decode() for one in certificates]
    joined = ",\n".join(lines)
    return f'{{"version": {SET_VERSION}, "instances": [\n{joined}\n]}}\n'.encode()


def _certified(instance: Instance, _: Callable[[int], None]) -> Certificate:
    return certify(instance)


def main(path: Path) -> None:
    """Compute all certificates, in parallel, and write the list to `path`."""

    def show(done: int, _: int) -> None:
        sys.stderr.write(f"\r{done} instances")

    with ParallelMap(_certified, usable_processors(), show) as computed:
        write_atomically(path, list_content(one for _, one in computed.results(instances())))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
