"""Problems with very many robots, stored as numpy arrays, without files or objects. Each robot has one variable.

The runtime `arrays` solves them (docs/guides/arrays.md).
"""

from __future__ import annotations

import copy
import operator
import re
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robochoc.communication.arrays.array_runs import array_run_for
from robochoc.communication.arrays.array_types import Floats, Integers
from robochoc.communication.arrays.blocks import BlockReport, Limits, RunBlock, run_on_cluster
from robochoc.communication.arrays.compiled import sort_order
from robochoc.communication.arrays.cycle_run import CycleRun, cycles_of, exact_sum
from robochoc.communication.arrays.description import Description, KnownConstraints
from robochoc.communication.arrays.layout import ArrayLayout
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import INFINITE
from robochoc.modelling.option_names import errors_in_python
from robochoc.modelling.solving import ARGUMENTS
from robochoc.protocols.message import encode
from robochoc.protocols.settings import read_settings
from robochoc.protocols.shared.cycles import CycleCount, CycleProtocol, Domain, Value
from robochoc.run.compatibility.setting_rules import refuse_settings
from robochoc.run.option_values import texts_by_name
from robochoc.run.options import Options
from robochoc.run.registry import protocol_named
from robochoc.solver.errors import UnsupportedError
from robochoc.system.errors import OptionTypeError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import counted
from robochoc.verification.checker import RefutedError

_TABLE = _PAIR = 2
"""The number of axes of one table, and the number of robots on an edge."""
MOST_ROBOTS = 1 << 31
"""The most robots: the square of this number fits into 64 bits."""


@dataclass(frozen=True)
class ArraySolution:
    """The result of a run on arrays.

    Attributes:
        verdict: `solution`, `no-solution`, or `unknown` if every cycle violates a hard constraint.
        values: The values in the cheapest cycle, by robot. None: every cycle violates a hard constraint.
        cost: The cost of `values`. None: there are no values.
        costs: The cost of every cycle, starting with cycle 0; `inf` if the cycle violates a hard constraint.
        metrics: The messages by type, bytes, checks and NCCCs (0 if not counted), as in the simulator.
    """

    verdict: Verdict
    values: Integers | None
    cost: int | None
    costs: tuple[float, ...]
    metrics: Metrics

    def __repr__(self) -> str:
        found = "" if self.cost is None else f", cost {self.cost:,}"
        sent = sum(self.metrics.messages.values())
        return (
            f"<{self.verdict}{found}: the best of {counted(max(len(self.costs) - 1, 0), 'cycle')}, {sent:,} messages>"
        )


class ArrayProblem:
    """A team of robots with one variable each, whose values are 0, 1, ..., and with costs between pairs of robots.

    Robots are numbered from 0, the highest in the priority order.

    Args:
        robots: The number of robots.
        values: The number of values of each variable.
        edges: The pairs of robots that share a table of costs, one row for each pair.
        tables: The costs for pairs of values: the row is the value of the edge's first robot, the column is the value
            of the second robot. One table for all edges, one for each edge, or several from which `which` chooses.
            Costs are integers of 0 or more, or `inf` for forbidden pairs.
        which: The index of each edge's table.
        charges: The unary costs of the values, one row for each robot.
        names: The names of the robots, which determine their random numbers. None: R0, R1, ...

    Raises:
        ValueError: if the arrays are invalid.

    Example:
        >>> import numpy as np
        >>> from robochoc.modelling.array_problem import ArrayProblem
        >>> ring = ArrayProblem(4, 3, [(0, 1), (1, 2), (2, 3), (3, 0)], np.eye(3))
        >>> ring.solve("dsa", cycles=20).cost
        0
    """

    def __init__(
        self,
        robots: int,
        values: int,
        edges: ArrayLike,
        tables: ArrayLike,
        *,
        which: ArrayLike | None = None,
        charges: ArrayLike | None = None,
        names: Iterable[str] | None = None,
    ) -> None:
        self.robots = _index("robots", robots)
        self.values = _index("values", values)
        pairs = _whole("edges", edges)
        self.edges = pairs if pairs.size else pairs.reshape(-1, _PAIR)
        given = _numbers("tables", tables).astype(np.float64)
        self.tables = given[None] if given.ndim == _TABLE else given
        self.charges = None if charges is None else _numbers("charges", charges).astype(np.float64)
        self.names = None if names is None else list(names)
        self._check_shapes()
        self.which = self._tables_of_edges(which)
        self._check()

    def solve(
        self,
        protocol: str = "dsa",
        *,
        seed: int = 0,
        timeout: float | None = None,
        ncccs: bool = True,
        cluster: str | None = None,
        start: ArrayLike | None = None,
        **settings: object,
    ) -> ArraySolution:
        """Solve the problem by a protocol that supports arrays, and check the cost of the answer.

        Args:
            protocol: The protocol: dsa, mgm, mgm2 or maxsum.
            seed: The seed of the robots' random numbers.
            timeout: A time limit in seconds, checked after each cycle.
            ncccs: True to count NCCCs, which takes up to a fifth of the time of mgm2 and maxsum.
            cluster: The address of a Dask scheduler, or the path of its file. Its workers compute one block of robots
                each, with the same results. None: this process computes all robots.
            start: The value with which each robot begins, such as the `values` of an earlier solution; -1: a random
                value. None: all begin with random values. `maxsum` ignores it.
            **settings: The protocol's settings, such as `cycles` or `variant`.

        Returns:
            The values in the cheapest cycle (anytime), and the metrics of the run.

        Raises:
            UnknownProtocolError: if no such protocol is installed.
            UnsupportedError: if the protocol does not support arrays, a setting is not allowed, or costs are too large.
            ClusterLostError: if a worker, or the cluster's scheduler, is lost.
            RefutedError: if the cost of the answer differs from the cost that the run reported.
            ValueError: if the value of an option is not allowed.
            TypeError: if the value of an option has the wrong type.
        """
        limit_s = Options(timeout=timeout).timeout
        began = time.monotonic()
        if cluster is not None:
            with _errors_in_python():
                how = RunBlock(*_how(protocol, seed, settings, cluster=True), Limits(limit_s), ncccs)
                described = replace(self._described(), starts=self._starts(start))
                report = run_on_cluster(cluster, described, how)
            return self._solution(report, report.robots, replace(report.metrics, wall_s=time.monotonic() - began))
        run = self.run(protocol, seed=seed, ncccs=ncccs, start=start, **settings)
        for _ in cycles_of(run):
            if limit_s is not None and time.monotonic() - began > limit_s and not run.is_over:
                run.end()
                break
        return self._solution(run, run.layout.robots, run.metrics(time.monotonic() - began))

    def run(
        self,
        protocol: str = "dsa",
        *,
        seed: int = 0,
        ncccs: bool = True,
        start: ArrayLike | None = None,
        **settings: object,
    ) -> CycleRun:
        """Return an unstarted run, for callers that need each cycle (`cycles_of`). See `solve` for the arguments."""
        with _errors_in_python():
            form, chosen, seed = _how(protocol, seed, settings)
            return form(self._layout_from(self._starts(start)), chosen, seed, clocks=ncccs)

    def cost(self, values: ArrayLike) -> float:
        """Return the cost of an assignment to all robots. Raises `ValueError` if a value is missing or invalid."""
        values = _whole("values", values)
        if values.shape != (self.robots,) or not _within(values, self.values):
            raise ValueError(f"expected a value from 0 to {self.values - 1:,} for each of {self.robots:,} robots")
        first, second = self.edges.T
        paid = exact_sum(self.tables[self.which, values[first], values[second]])
        if self.charges is not None:
            paid += exact_sum(self.charges[np.arange(self.robots), values])
        return paid

    @cached_property
    def layout(self) -> ArrayLayout:
        """The arrays for the runtime, computed once."""
        return ArrayLayout(self._described())

    def _starts(self, start: ArrayLike | None) -> Integers | None:
        """Return the start values. Raises `ValueError` if a value is missing or invalid."""
        if start is None:
            return None
        values = _whole("start", start)
        if values.shape != (self.robots,) or not _within(values + 1, self.values + 1):
            raise ValueError(
                f"start must have a value from 0 to {self.values - 1:,}, or -1, for each of {self.robots:,} robots"
            )
        return values

    def _layout_from(self, starts: Integers | None) -> ArrayLayout:
        """Return the arrays for a run with these start values."""
        if starts is None:
            return self.layout
        layout = copy.copy(self.layout)
        layout.description = replace(layout.description, starts=starts)
        return layout

    def __repr__(self) -> str:
        return f"<array problem: {self.robots:,} robots, {len(self.edges):,} edges, {self.values:,} values>"

    def _described(self) -> Description:
        held = self._held()
        keys = held.owners * self.robots + held.others[:, 0]
        keys = keys[np.diff(keys, prepend=-1) > 0]
        lengths = [len(encode(Value((value,)))) for value in range(self.values)]
        alike = len(set(lengths)) == 1
        return Description(
            names=self.names or _Names(self.robots),
            sizes=np.full(self.robots, self.values),
            degrees=np.bincount(keys // self.robots, minlength=self.robots),
            neighbours=keys % self.robots,
            charges=None if self.charges is None else self.charges.ravel(),
            held=[held] if len(self.edges) else [],
            value_bytes=lengths[0] if alike else np.tile(lengths, self.robots),
            domain_bytes=len(encode(Domain([(value,) for value in range(self.values)]))),
        )

    def _held(self) -> KnownConstraints:
        """Return the constraints as each of an edge's two robots knows them."""
        first, second = self.edges.T
        turned = self.tables.swapaxes(1, 2)
        alike = bool((turned == self.tables).all())
        keys = np.concatenate([second * self.robots + first, first * self.robots + second])
        order = sort_order(keys)
        owners, others = np.divmod(keys[order], self.robots)
        which = np.concatenate([self.which, self.which if alike else self.which + len(self.tables)])[order]
        tables: Floats = self.tables if alike else np.concatenate([self.tables, turned])
        return KnownConstraints(owners, others[:, None], tables, which, np.arange(len(owners)))

    def _solution(self, run: CycleRun | BlockReport, robots: Integers, metrics: Metrics) -> ArraySolution:
        """Return the checked solution. `robots` are the robots in the rows of the run's values."""
        last = not run.costs or run.costs[-1] <= min(run.costs)
        rows = run.values if last else run.best
        values = np.zeros(self.robots, rows.dtype)
        values[robots] = rows
        cost = min(run.costs, default=INFINITE)
        if run.costs and self.cost(values) != cost:
            raise RefutedError(f"the answer costs {self.cost(values):g}, but the run reported {cost:g}")
        found = cost < INFINITE and run.verdict is None
        verdict = run.verdict or (Verdict.SOLUTION if found else Verdict.UNKNOWN)
        return ArraySolution(
            verdict, values if found else None, int(cost) if found else None, tuple(run.costs), metrics
        )

    def _tables_of_edges(self, which: ArrayLike | None) -> Integers:
        """Return the index of each edge's table."""
        if which is not None:
            return _whole("which", which)
        several = len(self.tables) > 1
        return np.arange(len(self.tables)) if several else np.zeros(len(self.edges), np.int64)

    def _check_shapes(self) -> None:
        """Raise `ValueError` if the sizes, with which `_check` compares the arrays, are invalid."""
        shape = (self.values, self.values)
        _refuse_first(
            {
                "robots and values must be 1 or more": self.robots < 1 or self.values < 1,
                f"there can be at most {MOST_ROBOTS:,} robots": self.robots > MOST_ROBOTS,
                "edges must have two columns": self.edges.shape[1:] != (_PAIR,),
                f"tables must have the shape {shape} or (number, *{shape})": self.tables.shape[1:] != shape,
            }
        )

    def _check(self) -> None:
        """Raise `ValueError` for invalid entries."""
        _refuse_first(
            {
                "an edge must connect two different robots": bool((self.edges[:, 0] == self.edges[:, 1]).any()),
                f"robots in edges must be numbers from 0 to {self.robots - 1:,}": not _within(self.edges, self.robots),
                "there must be one table for each edge": self.which.shape != (len(self.edges),),
                "`which` must contain numbers of tables": not _within(self.which, len(self.tables)),
                f"charges must have the shape {(self.robots, self.values)}": self.charges is not None
                and self.charges.shape != (self.robots, self.values),
                "costs must be integers of 0 or more, or inf": not _are_costs(self.tables),
                "charges must be integers of 0 or more": self.charges is not None
                and not (_are_costs(self.charges) and np.isfinite(self.charges).all()),
                "each robot must have a unique name": self.names is not None
                and not _are_names(self.names, self.robots),
            }
        )


def _how(
    protocol: str, seed: int, settings: Mapping[str, object], *, cluster: bool = False
) -> tuple[type[CycleRun], CycleCount, int]:
    """Return the array form of the protocol, its settings, and the seed."""
    kind = protocol_named(Options(protocol=protocol).protocol)
    for name in settings:
        if name in ARGUMENTS and not hasattr(kind.settings, name):
            raise OptionTypeError(f"ArrayProblem has no option {name!r}: it runs as arrays; robochoc.Model has it")
    options = Options(protocol=protocol, seed=seed, settings=texts_by_name("settings", settings))
    refuse_settings(options.protocol, kind, options.settings)
    form = array_run_for(kind, cluster=cluster)
    if not issubclass(kind, CycleProtocol):
        raise UnsupportedError(f"{options.protocol} does not work in cycles")
    known = read_settings(kind, options.settings)
    return form, known if isinstance(known, type(kind.settings)) else kind.settings, options.seed


@contextmanager
def _errors_in_python() -> Iterator[None]:
    """Name arguments instead of options. Recommend `robochoc.Model` instead of another runtime."""
    with errors_in_python(("settings", "runtime", "cluster")):
        try:
            yield
        except UnsupportedError as error:
            text = re.sub(r"\b(add|use) --runtime simulator\b", "use robochoc.Model", str(error))
            raise UnsupportedError(text) from None


def _refuse_first(faults: Mapping[str, bool]) -> None:
    """Raise `ValueError` for the first violated rule."""
    for rule, broken in faults.items():
        if broken:
            raise ValueError(f"invalid arrays: {rule}")


def _index(name: str, given: int) -> int:
    try:
        return operator.index(given)
    except TypeError:
        raise ValueError(f"{name} must be an integer, not {given!r}") from None


def _numbers(name: str, given: ArrayLike) -> NDArray[Any]:
    """Return `given` as an array. Raises `ValueError` unless it contains only real numbers."""
    try:
        found = np.asarray(given)
    except (ValueError, TypeError):  # rows of different lengths
        raise ValueError(f"{name} are not an array of numbers") from None
    if found.dtype.kind not in "biuf":
        raise ValueError(f"{name} are not an array of numbers: numpy converts them to {found.dtype}")
    return found


def _whole(name: str, given: ArrayLike) -> Integers:
    """Return `given` as an array of integers. Raises `ValueError` unless it contains only integers."""
    found = _numbers(name, given)
    if found.dtype.kind == "b" or not (np.isfinite(found) & (np.floor(found) == found)).all():
        raise ValueError(f"{name} are not an array of integers")
    whole: Integers = found.astype(np.int64)
    return whole


def _within(numbers: Integers, end: int) -> bool:
    return bool(((numbers >= 0) & (numbers < end)).all())


def _are_names(names: Sequence[object], many: int) -> bool:
    return len(names) == many == len(set(names)) and all(isinstance(name, str) for name in names)


def _are_costs(costs: Floats) -> bool:
    return bool(((costs >= 0) & (np.isinf(costs) | (np.floor(costs) == costs))).all())


class _Names(Sequence[str]):
    """The names R0, R1, ..., computed on demand."""

    def __init__(self, many: int) -> None:
        self._many = many

    def __len__(self) -> int:
        return self._many

    def __getitem__(self, place):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN204 - always an integer
        return f"R{place}"
