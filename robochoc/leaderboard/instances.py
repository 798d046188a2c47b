"""The benchmark set: families of problems, ten seeds each.

An instance is a generator with its parameters and a seed, so no files are shipped. The name of an instance consists of
its family, its size and its seed: `scale-free-small-7`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import cache
from types import MappingProxyType

from robochoc.experiments.execute import team_of
from robochoc.experiments.task import Parameter, ProblemSpec
from robochoc.model.problem import Team
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.suggestions import did_you_mean

SET_VERSION = 1
"""The version of the set. It changes whenever an instance changes."""
SIZES = ("small", "medium")
"""The published sizes. A further size needs its parameters in each family, and certificates (`make benchmark-set`)."""
SEEDS = 10
"""The number of instances of each family and size."""
CP_SAT, TOULBAR2, COSOCO, DPOP = "ortools", "toulbar2", "cosoco", "dpop"


class UnknownInstanceError(RobochocError, LookupError):
    """The set has no instance, family or size with that name."""


@dataclass(frozen=True)
class BenchmarkFamily:
    """A family of the set.

    Attributes:
        title: The title.
        source: The paper that introduced the problems.
        generator: The family in `robochoc.generators.families`.
        common: The parameters shared by all sizes.
        sizes: The parameters of each size.
        solvers: The two solvers that certify the optima: of the merged problem, or the distributed protocol `dpop`.
        medium_solvers: The solvers of the size `medium`, if they differ. If there is only one, its answers count as
            the best known ones, since no second solver confirms them.
        events: The number of changes over time. 0: the problem does not change.
        measures_privacy: True if the privacy loss is measured.
        has_seeds: False if there is one instance of each size.
    """

    title: str
    source: str
    generator: str
    common: Mapping[str, Parameter]
    sizes: Mapping[str, Mapping[str, Parameter]]
    solvers: tuple[str, ...] = (TOULBAR2, CP_SAT)
    medium_solvers: tuple[str, ...] = ()
    events: int = 0
    measures_privacy: bool = False
    has_seeds: bool = True


FAMILIES: Mapping[str, BenchmarkFamily] = MappingProxyType(
    {
        "random": BenchmarkFamily(
            "Random binary problems",
            "Model B: Prosser, AIJ 81, 1996; Gent et al., Constraints 6, 2001",
            "random",
            {"domain": 5, "max_cost": 100},
            {"small": {"agents": 10, "density": 0.4}, "medium": {"agents": 40, "density": 0.15}},
            (TOULBAR2, DPOP),
            medium_solvers=(TOULBAR2,),
        ),
        "nary": BenchmarkFamily(
            "Random ternary problems",
            "Model RB: Xu and Li, JAIR 12, 2000",
            "nary",
            {"domain": 3, "arity": 3, "max_cost": 100},
            {"small": {"agents": 10, "constraints": 10}, "medium": {"agents": 30, "constraints": 30}},
            (TOULBAR2, DPOP),
        ),
        "scale-free": BenchmarkFamily(
            "Scale-free graphs",
            "Barabási and Albert, Science 286, 1999",
            "random",
            {"graph": "scale-free", "domain": 4, "max_cost": 100},
            {"small": {"agents": 12}, "medium": {"agents": 40}},
            (TOULBAR2, DPOP),
        ),
        "small-world": BenchmarkFamily(
            "Small worlds",
            "Watts and Strogatz, Nature 393, 1998",
            "random",
            {"graph": "small-world", "domain": 4, "max_cost": 100},
            {"small": {"agents": 12}, "medium": {"agents": 30}},
            (TOULBAR2, DPOP),
        ),
        "coloring-weighted": BenchmarkFamily(
            "Weighted graph colouring",
            "Koljonen et al., SASO 2010",
            "coloring",
            {"colors": 3, "conflicts": "weighted", "max_cost": 100},
            {"small": {"agents": 12, "degree": 5.0}, "medium": {"agents": 40, "degree": 5.0}},
            (TOULBAR2, DPOP),
        ),
        "coloring-hard": BenchmarkFamily(
            "Hard graph colouring",
            "Yokoo et al., TKDE 10, 1998",
            "coloring",
            {"colors": 3, "conflicts": "hard", "degree": 4.2},
            {"small": {"agents": 20}, "medium": {"agents": 50}},
        ),
        "meetings": BenchmarkFamily(
            "Meeting scheduling",
            "Maheswaran et al., AAMAS 2004",
            "meetings",
            {"model": "peav"},
            {"small": {"agents": 5, "meetings": 5, "slots": 4}, "medium": {"agents": 30, "meetings": 20, "slots": 6}},
        ),
        "sensors": BenchmarkFamily(
            "Sensor networks",
            "Béjar et al., AIJ 161, 2005",
            "grid-sensors",
            {"model": "sensors"},
            {"small": {"rows": 4, "columns": 4, "targets": 3}, "medium": {"rows": 6, "columns": 6, "targets": 4}},
        ),
        "tracking": BenchmarkFamily(
            "Target tracking",
            "Zivan et al., JAAMAS 29, 2015",
            "tracking",
            {},
            {"small": {"agents": 6, "targets": 5, "side": 8}, "medium": {"agents": 30, "targets": 20, "side": 20}},
        ),
        "smart-homes": BenchmarkFamily(
            "Smart lighting",
            "Rust et al., IJCAI 2016",
            "smart-homes",
            {"levels": 4},
            {"small": {"agents": 9, "rules": 6}, "medium": {"agents": 30, "rules": 25}},
            medium_solvers=(TOULBAR2, DPOP),
        ),
        "frequencies": BenchmarkFamily(
            "Frequency assignment",
            "Cabon et al., Constraints 4, 1999",
            "frequencies",
            {},
            {
                "small": {"agents": 10, "frequencies": 4, "distance": 40},
                "medium": {"agents": 30, "frequencies": 6, "distance": 30},
            },
            medium_solvers=(TOULBAR2, DPOP),
        ),
        "tasks": BenchmarkFamily(
            "Task allocation",
            "Gerkey and Matarić, IJRR 23, 2004",
            "tasks",
            {"skills": 2},
            {"small": {"agents": 6, "tasks": 6}, "medium": {"agents": 20, "tasks": 8}},
        ),
        "queens3d": BenchmarkFamily(
            "Queens in three dimensions",
            "the paper of the platform, Section 5.1",
            "queens3d",
            {},
            {"small": {"n": 3}, "medium": {"n": 5}},
            has_seeds=False,
        ),
        "dynamic": BenchmarkFamily(
            "Random problems that change",
            "Yeoh et al., AAMAS 2011",
            "random",
            {"domain": 4, "max_cost": 100},
            {"small": {"agents": 8, "density": 0.4}, "medium": {"agents": 20, "density": 0.2}},
            (TOULBAR2, DPOP),
            events=4,
        ),
        "asymmetric": BenchmarkFamily(
            "Asymmetric random problems",
            "Grinshpoun et al., JAIR 47, 2013",
            "random",
            {"domain": 4, "max_cost": 100, "asymmetric": True},
            {"small": {"agents": 8, "density": 0.4}, "medium": {"agents": 20, "density": 0.2}},
            (TOULBAR2, COSOCO),
        ),
        "privacy": BenchmarkFamily(
            "Meetings whose preferences are private",
            "Greenstadt, Pearce and Tambe, AAAI 2006",
            "meetings",
            {"model": "eav"},
            {"small": {"agents": 5, "meetings": 5, "slots": 4}, "medium": {"agents": 20, "meetings": 20, "slots": 6}},
            measures_privacy=True,
        ),
    }
)
"""The families by name. The kinds of colouring and of random problems have separate names: 14 kinds, 16 families."""
_CHANGES = "add-constraint remove-constraint add-value remove-value"
_RATE = 0.1


@dataclass(frozen=True)
class Instance:
    """An instance of the set.

    Attributes:
        family: The name of its family.
        size: Its size.
        seed: Its seed, from 0.
    """

    family: str
    size: str
    seed: int

    @property
    def name(self) -> str:
        """The name."""
        return f"{self.family}-{self.size}-{self.seed}"

    @property
    def group(self) -> BenchmarkFamily:
        """The family."""
        return FAMILIES[self.family]

    @property
    def solvers(self) -> tuple[str, ...]:
        """The solvers that certify the answer."""
        group = self.group
        return (self.size == "medium" and group.medium_solvers) or group.solvers

    @property
    def problem(self) -> ProblemSpec:
        """The problem, as in a study."""
        group = self.group
        seed = {"seed": self.seed} if group.has_seeds else {}
        scenario = {"events": group.events, "rate": _RATE, "seed": self.seed, "kinds": _CHANGES} if group.events else {}
        parameters = {**group.common, **group.sizes[self.size], **seed}
        return ProblemSpec(group=self.family, family=group.generator, parameters=parameters, scenario=scenario)

    def team(self) -> Team:
        """Return the generated team."""
        return team_of(self.problem)


def instances(
    families: Collection[str] = (), sizes: Collection[str] = (), seeds: Collection[int] = ()
) -> Iterator[Instance]:
    """Yield the instances of some families, sizes and seeds; an empty collection stands for all.

    Raises:
        UnknownInstanceError: if there is no such family or size.
    """
    _check(families, FAMILIES, "family")
    _check(sizes, SIZES, "size")
    for name, family in FAMILIES.items():
        for size in SIZES:
            for seed in range(SEEDS if family.has_seeds else 1):
                if (name in (families or (name,))) and size in (sizes or (size,)) and seed in (seeds or (seed,)):
                    yield Instance(name, size, seed)


def _check(names: Collection[str], known: Collection[str], what: str) -> None:
    for name in names:
        if name not in known:
            hint = did_you_mean(name, known, f"there are {', '.join(known)}")
            raise UnknownInstanceError(f"the benchmark set has no {what} {name!r}; {hint}")


@cache
def _by_name() -> Mapping[str, Instance]:
    return {one.name: one for one in instances()}


def instance_named(name: str) -> Instance:
    """Return the instance called `name`.

    Raises:
        UnknownInstanceError: if there is none; the error suggests another name.
    """
    if name not in _by_name():
        hint = did_you_mean(name, _by_name(), "'robochoc leaderboard list' shows all")
        raise UnknownInstanceError(f"the benchmark set has no instance {name!r}; {hint}")
    return _by_name()[name]
