"""The published list of the benchmark set: the digest of each instance, and its answer with the solvers that proved it.

`python -m robochoc.leaderboard.certificates FILE` computes the list again (`make benchmark-set`). The two solvers of an
instance share no code: one finds the answer, and the other one proves the same verdict and cost. An answer that only
one solver can prove is the best known one: the list has its assignment, whose cost anyone can compute again.
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
    """The solvers of an instance disagree, or one of them proved nothing."""


BEST_KNOWN = "best-known"
"""The verdict of an instance whose answer is not proved by two solvers."""


class Certificate(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
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
        verdict: The verdict: `optimal` or `best-known`, or `solution` or `no-solution` without costs. Of problems that
            change: of the last epoch.
        cost: The optimal cost, or the best known one.
        bound: The proven bound of the cost: no assignment is better. It equals the cost of an optimum.
        proved_by: The solver that proved the answer, or the bound.
        agreed_by: The second solver, which proved the same. Empty for a best known answer.
        found_by: The solver that found a best known answer.
        assignment: A best known answer.
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
    found_by: str = ""
    assignment: dict[str, int] = {}

    @property
    def provers(self) -> str:
        """The solvers that proved the answer or the bound, in words."""
        return " and ".join(filter(None, [self.proved_by, self.agreed_by]))

    @property
    def known(self) -> str:
        """The cost and the bound as part of a sentence, for answers with costs."""
        if self.verdict == BEST_KNOWN:
            return f"the best known cost is {self.cost}, and the bound {self.bound}"
        return f"{self.provers} proved {self.cost}"

    def is_reached_by(self, cost: int) -> bool:
        """Return whether a cost is at least as good as the best known one, and not better than the bound."""
        best, bound = self.cost or 0, self.bound or 0
        return min(best, bound) <= cost <= max(best, bound)

    def is_beyond_bound(self, cost: int, *, is_maximised: bool) -> bool:
        """Return whether a cost is better than the proven bound allows."""
        bound = self.bound or 0
        return cost > bound if is_maximised else cost < bound


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
    """Return the certificate of an instance, computed by its solvers.

    Raises:
        DisputedInstanceError: if the solvers disagree, or one of them proved nothing.
    """
    team = instance.team()
    problem = instance.problem
    first, *others = instance.solvers
    outcome = _outcome(team, first)
    verdict, cost = answer_of(outcome)
    if verdict == Verdict.UNKNOWN:
        raise DisputedInstanceError(f"{instance.name}: {first} proved nothing within {TIMEOUT_S:g} s")
    for second in others:
        if (verdict, cost) != (again := answer_of(_outcome(team, second))):
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
        verdict=verdict if others else BEST_KNOWN,
        cost=cost,
        bound=cost,
        proved_by=first,
        agreed_by=others[0] if others else "",
        found_by="" if others else first,
        assignment={} if others else dict(outcome.assignment),
    )


def _outcome(team: Team, solver: str) -> Outcome:
    if solver == DPOP:
        options = Options(protocol=DPOP, runtime=Runtime.SIMULATOR, timeout=TIMEOUT_S)
    else:
        options = Options(protocol=CENTRAL, central_with=CentralSolverName(solver), timeout=TIMEOUT_S, cache=False)
    return solve(team, options)


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
    """Compute all certificates, in parallel, and write the list to `path`. A terminal shows the progress."""
    show = _show if sys.stderr.isatty() else None
    with ParallelMap(_certified, usable_processors(), show) as computed:
        write_atomically(path, list_content(one for _, one in computed.results(instances())))
    if show:
        sys.stderr.write("\n")


def _show(done: int, _: int) -> None:
    sys.stderr.write(f"\r{done} instances")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
