"""A solution is a mapping of the user's values, here and in the process that receives it."""

from __future__ import annotations

import copy
import json
import pickle
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from decimal import Decimal
from enum import Enum
from fractions import Fraction
from multiprocessing import get_context
from typing import Any

import pytest

import robochoc
from robochoc.formats.result import read_result, result_json
from robochoc.model.outcome import Improvement, Verdict
from robochoc.modelling.errors import ModelTypeError, UnknownNameError
from robochoc.modelling.solution import Solution


class Colour(Enum):
    """A domain that is neither numbers nor texts."""

    RED = 1
    GREEN = 2


def coloured() -> tuple[robochoc.Model, list[Any]]:
    """Return a model of two robots with different colours, and their variables."""
    model = robochoc.Model("colours")
    variables = [model.robot(f"r{i}").variable("x", Colour) for i in range(2)]
    model.add(variables[0] != variables[1])
    return model, variables


def solved(model: robochoc.Model) -> Solution:
    """Solve a model in the simulator."""
    return model.solve("abt", runtime="simulator")


def test_a_solution_is_a_mapping() -> None:
    model, (x, y) = coloured()
    found = solved(model)
    assert isinstance(found, Mapping)
    assert dict(found) == found.values == {"r0.x": found[x], "r1.x": found[y]}
    assert {found[x], found[y]} == set(Colour)
    assert (len(found), list(found), list(found.keys())) == (2, ["r0.x", "r1.x"], ["r0.x", "r1.x"])
    assert list(found.items()) == list(found.values.items())
    assert list(found.values()) == [found[x], found[y]]
    assert (found.get("r0.x"), found.get("other", 3)) == (found[x], 3)
    assert {**found} == found.values


def test_a_solution_is_true_if_there_is_an_assignment() -> None:
    model, (x, y) = coloured()
    assert solved(model)
    model.add(x == y)
    assert not solved(model)
    assert dict(solved(model)) == {}


def test_terms_are_contained_where_they_have_a_value() -> None:
    model = robochoc.Model("numbers")
    x, y = (model.robot(f"r{i}").variable("x", range(i, 3)) for i in range(2))
    model.add(x + y == 1)
    found = solved(model)
    other = robochoc.Model("other").robot("r0").variable("z", range(3))
    for what in (x, y, x + 1, x == y, "r0.x", y // y):
        assert what in found
        assert found[what] is not None
    for what in (other, other + x, "r0.z", y // x):
        assert what not in found
        with pytest.raises(UnknownNameError):
            found[what]
    assert not any(one in found for one in (3, None, ()))  # type: ignore[comparison-overlap]
    with pytest.raises(ModelTypeError, match="expected a variable, a term of variables, or a name"):
        found[[x, y]]  # type: ignore[index]


def test_variables_of_a_copy_are_found_by_owner_name_and_domain() -> None:
    model, (x, y) = coloured()
    found = pickle.loads(pickle.dumps(solved(model)))  # noqa: S301 - this test's own bytes
    assert (found[x], found[y], found[x != y]) == (found["r0.x"], found["r1.x"], True)
    assert copy.deepcopy(found)[x] == found["r0.x"]
    same = robochoc.Model("other")
    assert same.robot("r0").variable("x", [Colour.GREEN, Colour.RED]) in found
    for name, domain in (("r0", [Colour.RED]), ("r0", range(1, 3)), ("r0", bool)):
        foreign = robochoc.Model("other").robot(name).variable("x", domain)
        assert foreign not in found
        with pytest.raises(UnknownNameError, match=r"'r0\.x' is a variable of another model"):
            found[foreign]
    elsewhere = robochoc.Model("other").robot("r9").variable("r0.x", Colour, qualified=False)
    assert elsewhere not in found


def test_a_solution_from_another_process() -> None:
    model, (x, y) = coloured()
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found = pool.submit(solved, model).result()
    assert {found[x], found[y]} == set(Colour)


def test_listed_solutions_and_epochs_have_values() -> None:
    model, (x, _) = coloured()
    found = model.solve("list-dpop", runtime="simulator")
    assert [set(one.values()) for one in found.listed] == [set(Colour)] * 2
    assert found.listed[0] == found.values
    assert found.optima is not None
    assert found.values_of(found.optima.assignments[1]) == found.listed[1]
    assert model.values_of(found.optima.assignments[1]) == found.listed[1]
    model.after_solution().remove_value(x, Colour.RED)
    changed = model.solve("dynabt", runtime="simulator")
    assert [epoch.values for epoch in changed.epochs][1] == changed.values == {"r0.x": Colour.GREEN, "r1.x": Colour.RED}
    assert set(changed.epochs[0].values.values()) == set(Colour)
    assert read_result(result_json(changed)).epochs[1].cost == changed.epochs[1].cost


def test_numbers_with_a_common_unit_are_values_in_json() -> None:
    model = robochoc.Model("halves")
    x, y = (model.robot(f"r{i}").variable("x", [Decimal("1.5"), 2, Fraction(1, 3)]) for i in range(2))
    model.add(x > y)
    model.maximize(3 * (x + y))
    found = model.solve("dpop", runtime="simulator")
    assert (found[x], found[y]) == (2, Decimal("1.5"))
    told = json.loads(json.dumps(found.to_dict()))
    assert (told["assignment"], told["values"]) == ({"r0.x": 12, "r1.x": 9}, {"r0.x": 2, "r1.x": 1.5})
    assert "values" not in solved(coloured()[0]).to_dict()
    assert read_result(result_json(found, values={"r0.x": "1/3"})).assignment == found.assignment


def test_pandas_reads_values() -> None:
    pd = pytest.importorskip("pandas")
    model, _ = coloured()
    found = solved(model)
    assert pd.Series(found).to_dict() == found.values


def test_values_as_a_data_frame() -> None:
    pd = pytest.importorskip("pandas")
    model = robochoc.Model()
    x = [model.robot(f"r{i}").variable("x", ["red", "green"]) for i in range(3)]
    model.add(robochoc.all_different(x))
    frame = model.solve(withdraw=True).to_frame()
    assert [*frame.columns] == ["robot", "variable", "value", "withdrawn"]
    assert frame["variable"].tolist() == ["r0.x", "r1.x", "r2.x"]
    assert frame["withdrawn"].sum() == 1
    assert {*frame.loc[~frame["withdrawn"], "value"]} == {"red", "green"}
    assert pd.isna(frame.loc[frame["withdrawn"], "value"]).all()


def test_equal_runs_have_the_same_answer_and_equal_outcomes_the_same_hash() -> None:
    model, _ = coloured()
    first, second = solved(model), solved(model)
    slower = replace(second, metrics=replace(second.metrics, wall_s=9.0, compile_s=8.0, memory=7))
    assert first.same_answer(slower)
    assert slower.same_answer(first)
    assert first != slower
    assert not first.same_answer(replace(second, metrics=replace(second.metrics, checks=10**6)))
    assert not first.same_answer(replace(second, assignment={}))
    copied = copy.deepcopy(first)
    assert (copied, hash(copied)) == (first, hash(first))
    assert {first: 1}[copied] == 1
    outcome = read_result(result_json(first))
    assert isinstance(hash(outcome), int)


def test_epochs_and_improvements_are_compared_without_times() -> None:
    model, (x, y) = coloured()
    model.after_solution().add(x == y)
    first = solved(model)
    late = [replace(one, metrics=replace(one.metrics, wall_s=5.0)) for one in first.epochs]
    improvement = Improvement(0.5, Verdict.SOLUTION, None)
    known = replace(first, improvements=(improvement,))
    assert len(late) > 1
    assert first.same_answer(replace(first, epochs=tuple(late)))
    assert not first.same_answer(replace(first, epochs=tuple(late[:1])))
    assert known.same_answer(replace(first, improvements=(improvement._replace(at_s=0.7),)))
    assert not known.same_answer(first)


def test_keys_are_completed() -> None:
    model, _ = coloured()
    assert model._ipython_key_completions_() == ["r0.x", "r1.x"]
    assert solved(model)._ipython_key_completions_() == ["r0.x", "r1.x"]
