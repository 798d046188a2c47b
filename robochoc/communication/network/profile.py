"""A robot's profile, sent to the master instead of the file: its neighbours, and the variables that they see.

From profiles the master builds robots as others see them, without constraints and hidden variables. From these robots
it computes the common knowledge of the team: the priority order, the interfaces, the declared domains.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import msgspec

from robochoc.formats.definitions import MAX_VALUES
from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.names import is_name
from robochoc.formats.symbols import check_symbol
from robochoc.model.absence import broken, restated
from robochoc.model.cost_units import MAX_PLACES, CostUnits
from robochoc.model.costs import flat_units
from robochoc.model.priorities import CycleError, priority_order
from robochoc.model.problem import Child, Constraint, Domain, Parent, ProblemKind, Robot, Team, Variable, WhenAbsent
from robochoc.model.real import MOST_PLACES, RealInterval
from robochoc.solver.encoding import Cost, max_cost
from robochoc.system.errors import RobochocError

Ranges = tuple[tuple[int, int], ...]
"""A domain: the first and last value of each range, in ascending order."""

MOST_NEIGHBOURS = 10_000
MOST_VARIABLES = 10_000
LONGEST_NAME = 255
LARGEST_WEIGHT = 1_000_000
"""The largest weight of a robot, as in files."""
LARGEST_DEAREST = 2.0**80
"""An upper bound on the costs in any file, chosen so that the cost of withdrawing all robots is still finite."""


LARGEST_CONSTANT = 2**62
"""The largest constant that may be added to the costs of all constraints."""


class ProfileError(RobochocError, ValueError):
    """Raised if the profile of a robot is invalid."""


class Profile(msgspec.Struct, frozen=True, array_like=True):
    """The declarations of the robot `name` about its file.

    `variables` are the robot's interface variables with their domains. `looks_at` contains, by child, the child's
    variables in this robot's parts of partially known constraints; `wants` contains other robots' variables in the
    constraints that this robot shares with its parents. `max_cost` is the largest total cost of its constraints,
    without violations. `topics` are the topics in its decision. `cost_scale` contains its cost units: whether the sum
    is maximised, the decimal places, and a constant. `symbols` are the names of the team's symbols, in the order of
    their codes; empty if the robot knows no symbols. `symbolic` are those `variables` whose values are symbol codes.
    `real_places` are the decimal places of those `variables` whose values are real numbers; `on_grid` is true if any of
    the robot's variables, including hidden ones, is a real number, of which only a grid is searched. `sampled` is true
    if its costs are averages over samples of random variables.
    """

    name: str
    kind: ProblemKind
    parents: tuple[str, ...]
    children: tuple[str, ...]
    variables: dict[str, Ranges]
    looks_at: dict[str, tuple[str, ...]]
    weight: int
    max_cost: Cost
    topics: tuple[str, ...]
    wants: tuple[str, ...] = ()
    cost_scale: tuple[bool, int, int] = (False, 0, 0)
    symbols: tuple[str, ...] = ()
    symbolic: tuple[str, ...] = ()
    real_places: dict[str, int] = {}
    on_grid: bool = False
    sampled: bool = False

    @property
    def units(self) -> CostUnits:
        """The user's cost units, with the constant that was removed from the costs of the constraints."""
        return CostUnits(*self.cost_scale)

    @property
    def neighbours(self) -> tuple[str, ...]:
        """The neighbours: first the parents, then the children."""
        return (*self.parents, *self.children)


def profile_of(robot: Robot) -> Profile:
    """Return the profile of `robot`."""
    shown = set(robot.interface)
    own = {variable.name for variable in robot.variables}
    parts = [constraint for child in robot.children for constraint in child.constraints]
    units = flat_units(Team(robot.name, (robot,)))
    return Profile(
        name=robot.name,
        kind=robot.kind,
        parents=tuple(parent.name for parent in robot.parents),
        children=tuple(child.name for child in robot.children),
        variables={v.name: ranges_of(v.domain) for v in robot.variables if v.name in shown},
        looks_at={
            child.name: tuple(
                dict.fromkeys(name for part in child.constraints for name in part.variables if name not in own)
            )
            for child in robot.children
            if child.constraints
        },
        weight=robot.weight,
        max_cost=sum(max_cost(constraint) for constraint in (*robot.private, *robot.shared, *parts)),
        topics=tuple(topic.name for topic in robot.topics),
        wants=tuple(dict.fromkeys(name for one in robot.shared for name in one.variables if name not in own)),
        cost_scale=(units.maximize, units.places, units.constant),
        symbols=robot.symbol_table,
        symbolic=tuple(v.name for v in robot.variables if v.name in shown and v.domain.symbols),
        real_places={v.name: v.domain.real.places for v in robot.variables if v.name in shown and v.domain.real},
        on_grid=any(v.domain.real for v in robot.variables),
        sampled=robot.sampled,
    )


def ranges_of(domain: Domain) -> Ranges:
    """Return the ranges of the possible values of `domain` for sending."""
    possible = domain.possible
    ranges = (possible,) if isinstance(possible, range) else possible.ranges
    return tuple((part[0], part[-1]) for part in ranges)


def domain_of(name: str, ranges: Ranges) -> Domain:
    """Return the domain of the variable `name`. Raises `ProfileError` for ranges that are invalid or too large."""
    last: int | None = None
    size = 0
    for low, high in ranges:
        if low > high or (last is not None and low <= last):
            raise ProfileError(f"the ranges of {name} are not ascending")
        last, size = high, size + high - low + 1
    if not 0 < size <= MAX_VALUES:
        raise ProfileError(f"{name} has {size:,} values; 1 to {MAX_VALUES:,} are allowed")
    return Domain(name, tuple(range(low, high + 1) for low, high in ranges))


def visible_robot(profile: Profile, also: Mapping[str, Ranges]) -> Robot:
    """Return the robot as others see it. `also` contains variables that it disclosed later. Raises `ProfileError`."""
    looked_at = [name for names in profile.looks_at.values() for name in names]
    names = (profile.name, *profile.neighbours, *profile.variables, *looked_at, *profile.wants, *also)
    bad = next((name for name in names if not is_name(name) or len(name) > LONGEST_NAME), None)
    if bad is not None:
        raise ProfileError(f"{bad[:LONGEST_NAME]!r} is not a valid name")
    if (
        len(profile.neighbours) > MOST_NEIGHBOURS
        or max(map(len, (profile.variables, looked_at, profile.wants))) > MOST_VARIABLES
    ):
        raise ProfileError("it has too many neighbours or variables")
    if len({profile.name, *profile.neighbours}) <= len(profile.neighbours):
        raise ProfileError("it names itself, or a neighbour twice")
    unknown = profile.looks_at.keys() - set(profile.children)
    if unknown:  # the master would make these robots disclose variables to a robot that is not their neighbour
        raise ProfileError(f"it refers to variables of {min(unknown)[:LONGEST_NAME]}, which is not a child of it")
    if not (0 <= profile.cost_scale[1] <= MAX_PLACES and abs(profile.cost_scale[2]) <= LARGEST_CONSTANT):
        raise ProfileError("its cost units are out of range")
    if not (0 <= profile.max_cost <= LARGEST_DEAREST and 1 <= profile.weight <= LARGEST_WEIGHT):
        raise ProfileError(f"costs of {profile.max_cost:g} or a weight of {profile.weight} are out of range")
    if any(not 0 <= places <= MOST_PLACES for places in profile.real_places.values()):
        raise ProfileError(f"real numbers have 0 to {MOST_PLACES} decimal places")
    _check_symbols(profile)
    shown = {**profile.variables, **also}
    return Robot(
        name=profile.name,
        variables=tuple(Variable(name, _domain_in(profile, name, ranges)) for name, ranges in shown.items()),
        kind=profile.kind,
        parents=tuple(Parent(name) for name in profile.parents),
        children=tuple(Child(name) for name in profile.children),
        shown=tuple(shown),
        weight=profile.weight,
    )


def _check_symbols(profile: Profile) -> None:
    """Raise `ProfileError` if the symbols in `profile` are invalid."""
    if len(profile.symbols) > MAX_VALUES or len(set(profile.symbols)) < len(profile.symbols):
        raise ProfileError("it has too many symbols, or one of them twice")
    for name in profile.symbols:
        try:
            check_symbol(name)
        except MistakeError:
            raise ProfileError(f"{name[:LONGEST_NAME]!r} is not a valid symbol") from None


def _domain_in(profile: Profile, name: str, ranges: Ranges) -> Domain:
    """Return the domain of the variable `name` in `profile`, with symbols and real numbers. Raises `ProfileError`."""
    domain = domain_of(name, ranges)
    if name in profile.real_places:
        low, high = domain.ranges[0][0], domain.ranges[-1][-1]
        return replace(domain, real=RealInterval(low, high, profile.real_places[name]))
    if name not in profile.symbolic:
        return domain
    if not 0 <= domain.ranges[0][0] <= domain.ranges[-1][-1] < len(profile.symbols):
        raise ProfileError(f"a value of {name} is not the code of a symbol")
    return replace(domain, symbols=profile.symbols)


def profile_contradictions(profiles: Mapping[str, Profile]) -> Iterator[str]:
    """Yield contradictions between the profiles in a team: neighbours that disagree, variables with two owners."""
    owner: dict[str, str] = {}
    for profile in profiles.values():
        for variable in profile.variables:
            other = owner.setdefault(variable, profile.name)
            if other != profile.name:
                yield f"the variable {variable} is {other}'s, and {profile.name}'s too"
        for parent in profile.parents:
            if parent in profiles and profile.name not in profiles[parent].children:
                yield f"{profile.name} calls {parent} its parent, which does not list it as a child"
        for child in profile.children:
            if child in profiles and profile.name not in profiles[child].parents:
                yield f"{profile.name} calls {child} its child, which does not list it as a parent"
    kinds = {profile.kind: profile.name for profile in profiles.values()}
    if len(kinds) > 1:
        yield f"{' and '.join(f'{name} is a {kind}' for kind, name in kinds.items())}: a team is one or the other"
    yield from _differing_units(profiles)
    yield from _differing_symbols(profiles)
    try:
        priority_order({profile.name: profile.parents for profile in profiles.values()})
    except CycleError as cycle:
        yield f"the parents form a cycle: {cycle}"


def _differing_units(profiles: Mapping[str, Profile]) -> Iterator[str]:
    units = {profile.cost_scale[:2]: profile.name for profile in profiles.values()}
    if len(units) > 1:
        yield f"the costs of {' and '.join(units.values())} differ in objective or scale: write both into every file"


def _differing_symbols(profiles: Mapping[str, Profile]) -> Iterator[str]:
    names = {profile.symbols: profile.name for profile in profiles.values() if profile.symbols}
    if len(names) > 1:
        who = " and ".join(list(names.values())[:2])
        yield (
            f"the symbols of {who} have different codes: list all symbols of the team in the first domain of every"
            " file, as robochoc does where it writes them"
        )


def missing(profiles: Mapping[str, Profile]) -> set[str]:
    """Return the neighbours named in profiles that have not joined."""
    return {name for profile in profiles.values() for name in profile.neighbours} - profiles.keys()


def possible_neighbours(profiles: Mapping[str, Profile]) -> dict[str, tuple[str, ...]]:
    """Return, for each robot, the robots that may share a constraint with it: neighbours, and other parents of a child.

    The lowest robot in a scope holds the constraint, and the other robots in the scope are its parents.
    """
    found: dict[str, dict[str, None]] = {name: dict.fromkeys(one.neighbours) for name, one in profiles.items()}
    for profile in profiles.values():
        for parent in (one for one in profile.parents if one in found):
            found[parent].update(dict.fromkeys(other for other in profile.parents if other != parent))
    return {name: tuple(others) for name, others in found.items()}


def in_priority_order(profiles: Mapping[str, Profile]) -> Sequence[str]:
    """Return the total priority order of a team. Its profiles must not contradict each other."""
    return priority_order({profile.name: profile.parents for profile in profiles.values()})


def restrict_to_team(robot: Robot, interfaces: Mapping[str, Sequence[str]]) -> Robot:
    """Return `robot`, restricted to the team with these `interfaces`, which are in priority order.

    Neighbours that have left are removed. The robot's constraints that contain their variables are restated for the
    remaining robots, or dropped (`model/absence.py`). A remaining constraint over this robot's variables alone becomes
    private.

    The robot discloses exactly its variables in `interfaces`, in that order, because others use the order to read its
    values. The order may differ from the robot's file if it had to disclose more variables than the file lists.
    """
    shown = tuple(interfaces[robot.name])
    place = {name: number for number, name in enumerate(shown)}
    moved = iter(sorted((one for one in robot.variables if one.name in place), key=lambda one: place[one.name]))
    variables = tuple(next(moved) if one.name in place else one for one in robot.variables)
    own = {variable.name for variable in robot.variables}
    owners = {variable: name for name, names in interfaces.items() for variable in names}
    rank = {name: number for number, name in enumerate(interfaces)}

    def lowest(constraint: Constraint) -> str | None:
        """Return the lowest of the other robots in the scope, or None if there is no other robot."""
        others = {owners[name] for name in constraint.variables if name not in own}
        return max(others, key=rank.__getitem__, default=None)

    def kept(constraints: Iterable[Constraint]) -> Iterator[Constraint]:
        """Yield those of the remaining `constraints` that contain variables of this robot."""
        for constraint in constraints:
            gone = {name for name in constraint.variables if name not in own and name not in owners}
            left = restated(constraint, gone)
            if left is not None and constraint.when_absent == WhenAbsent.FAIL and gone:
                left = broken(left, (robot.variables[0].name,))
            if left is not None and not own.isdisjoint(left.variables):
                yield left

    held = {parent.name: list(kept(parent.constraints)) for parent in robot.parents}
    private = [replace(one, model=None) for found in held.values() for one in found if lowest(one) is None]
    under: dict[str | None, list[Constraint]] = {}
    every = [one for found in held.values() for one in found]
    for one in sorted(every, key=lambda left: left.original is not None):  # the same order as in `without_robots`
        under.setdefault(lowest(one), []).append(one)
    children = (child for child in robot.children if child.name in interfaces)
    return replace(
        robot,
        variables=variables,
        private=(*robot.private, *private),
        parents=tuple(
            replace(one, constraints=tuple(under.get(one.name, ()))) for one in robot.parents if one.name in interfaces
        ),
        children=tuple(
            replace(
                one,
                constraints=tuple(kept(one.constraints)),
                copies=tuple(copy for copy in kept(one.copies) if one.name in {owners.get(v) for v in copy.variables}),
            )
            for one in children
        ),
        shown=shown,
    )
