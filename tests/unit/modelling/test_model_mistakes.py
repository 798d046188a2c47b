"""What a model refuses: one message, which names the line of the user's program and what was meant."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import fields
from enum import Enum
from pathlib import Path
from typing import Any

import pytest

import robochoc
from robochoc.formats import InvalidInputError
from robochoc.model.problem import Team
from robochoc.modelling.errors import ModelTypeError, UnknownNameError
from robochoc.modelling.terms import ModelVariable
from robochoc.run.options import Options
from tests.support.cases import looped


class Color(Enum):
    RED = 1
    GREEN = 2


class Shape(Enum):
    RED = 1


class Made:
    """A model with variables of all kinds."""

    def __init__(self) -> None:
        self.model = robochoc.Model("made")
        self.a, self.b = self.model.robot("a"), self.model.robot("b")
        self.x, self.y = self.a.variable("x", range(3)), self.b.variable("y", range(3))
        self.color, self.shape = self.a.variable("color", Color), self.b.variable("shape", Shape)
        self.mode = self.a.variable("mode", ["fast", "slow"])
        self.on = self.a.boolean("on")
        self.large = [self.b.variable(f"l{n}", range(100)) for n in range(3)]


def stranger() -> ModelVariable:
    return robochoc.Model().robot("a").variable("x", range(3))


def _both_ways(made: Made) -> None:
    made.model.minimize(made.x)
    made.model.maximize(made.y)


def _built(made: Made, mistake: Callable[[Made], object]) -> Team:
    """Make a mistake, and build the team, where some are seen."""
    mistake(made)
    return made.model.team


MISTAKES: list[tuple[Callable[[Made], object], str]] = [
    (lambda m: bool(m.x == m.y), "has no truth value before"),
    (lambda m: math.sqrt(m.x + 1), "before the problem is solved (write robochoc.function(math.sqrt, x)"),
    (lambda m: m.model.add(object()), "compare terms"),
    (lambda m: 1 < m.x < 3, "1 < x < 3"),
    (lambda m: m.x in [m.y, 3], ".is_in"),
    (lambda m: min(m.x, m.y), "minimum"),
    (lambda m: list(m.x), "not a list"),
    (lambda m: m.color != m.shape, "they are never equal"),
    (lambda m: m.color == m.mode, "a Color, and a.mode is a text"),
    (lambda m: m.color == "RED", "never equal"),
    (lambda m: m.mode == "fats", "did you mean 'fast'"),
    (lambda m: m.color + 1, "not a number"),
    (lambda m: m.color < m.color, "supports only == and !="),
    (lambda m: m.x & m.y, "not a condition"),
    (lambda m: m.x + "1", "not a number"),
    (lambda m: m.x / m.y, "//"),
    (lambda m: m.x / 0, "division by zero"),
    (lambda m: m.model.add(m.x), "not a condition"),
    (lambda m: m.model.add(m.x is m.y), "always False"),
    (lambda m: m.model.add("x != y"), "not a condition"),
    (lambda m: m.model.add(stranger() == 1), "not a variable of this model"),
    (lambda m: m.model.minimize(m.color), "not a number"),
    (_both_ways, "minimised"),
    (lambda m: m.model.minimize(m.x / 3), "9 decimal places"),
    (lambda m: m.model.robot("a"), "already"),
    (lambda m: m.model.robot("a b"), "invalid robot name"),
    (lambda m: m.model.robot("scenario"), "invalid robot name"),
    (lambda m: m.model.robot("c", weight=0), "invalid weight"),
    (lambda m: m.model.robot("c"), "c has no variable"),
    (lambda m: m.a.variable("x", range(2)), "already"),
    (lambda m: m.a.variable("2 x", range(2)), "invalid variable name"),
    (lambda m: m.a.variable("v", []), "domain is empty"),
    (lambda m: m.a.variable("v", [1, "a"]), "of one kind"),
    (lambda m: m.a.variable("v", [[1], [2]]), "not hashable"),
    (lambda m: m.a.variable("v", [1, 1]), "occurs twice"),
    (lambda m: m.a.variable("v", "red green"), "['red', 'green']"),
    (lambda m: m.a.variable("v", 3), "invalid domain"),
    (lambda m: m.a.variable("v", range(10**9)), "more than 100,000"),
    (lambda m: m.a.variable("v", [10**18]), "18 digits"),
    (lambda m: m.model["a.xx"], "did you mean 'a.x'"),
    (lambda m: m.model["x"], "did you mean 'a.x'"),
    (lambda m: m.a["xx"], "a has no variable 'xx'"),
    (lambda m: m.a.knows(m.x == 1), "add it by Model.add: constraints over variables of one robot are private"),
    (lambda m: m.b.knows(m.x + m.y == 1, m.x == 1), "of a alone"),
    (lambda m: m.a.topic("t", x=m.y), "not a variable of a"),
    (lambda m: m.a.topic("t", x=m.x / 2), "files cannot express"),
    (lambda m: robochoc.all_different(m.x, m.color), "a number"),
    (lambda m: robochoc.allowed([m.x, m.y], [(1, 2, 3)]), "3 values for 2 terms"),
    (lambda m: robochoc.allowed([m.x, m.mode], [(1, "fats")]), "did you mean 'fast'"),
    (lambda m: robochoc.costs(m.x, {1: "much"}), "invalid cost"),
    (lambda m: robochoc.element([], m.x), "is empty"),
    (lambda m: robochoc.cumulative([m.x], [1, 2], [1], 1), "2 durations"),
    (lambda m: m.model.add(robochoc.function(lambda x: x, m.x)), "not a truth value"),
    (lambda m: m.model.add(robochoc.function(lambda x: {}[x], m.x)), "KeyError"),
    (lambda m: m.model.minimize(robochoc.function(str, m.x)), "not a number"),
    (lambda m: m.model.add(robochoc.function(max, *m.large) == 3), "1,000,000 combinations"),
    (lambda m: m.model.after_solution().remove_robot("c"), "no robot 'c'"),
    (lambda m: m.model.after_solution().remove_value(m.x, 7), "no value 7"),
    (lambda m: m.model.after_solution().add_value(m.x, "7"), "a text"),
    (lambda m: m.model.after_solution().remove_constraint("C9"), "no constraint 'C9'"),
    (lambda m: m.model.after_solution().add(m.x == 1), "of a alone"),
    (lambda m: m.model.add(m.model.after_solution().robot("late").variable("v", [1]) == 1), "event.add"),
    (lambda m: m.model.add(abs(m.large[0] * 10**17 - m.large[1] * m.large[2]) > 3), "beyond the limit of 2^63"),
    (lambda m: m.model.minimize(m.x * m.y * 5 * 10**17), "may reach 2000000000000000000; costs have at most 18 digits"),
    (lambda m: m.model.minimize(m.large[0] ** 6 * m.large[1] ** 6), "(b.l1 ** 6))) can be"),
    (lambda m: m.model.add(m.large[0] ** 10**6 * m.large[1] > 3), "1000000 has more than 4096 bits"),
    (lambda _: robochoc.Model().team, "no robot"),
]


@looped(("mistake", "says"), MISTAKES)
def test_a_mistake_is_told_with_its_line(mistake: Callable[[Made], object], says: str) -> None:
    made = Made()
    with pytest.raises(robochoc.ModelError) as refused:
        _built(made, mistake)
    assert says in str(refused.value)
    file, _, rest = str(refused.value).partition(":")
    assert Path(file).name == Path(__file__).name
    assert int(rest.partition(":")[0]) > 0
    assert "\n" not in str(refused.value)


def test_bounds_instead_of_a_domain_and_a_robot_that_exists() -> None:
    model = robochoc.Model()
    robot = model.robot("r")
    variable: Any = robot.variable
    with pytest.raises(ModelTypeError, match=r"one domain, not 0, 3 \(write range\(0, 4\)"):
        variable("x", 0, 3)
    with pytest.raises(ModelTypeError, match=r"one domain, not \[1\], 3 \(expected a range"):
        variable("x", [1], 3)
    with pytest.raises(robochoc.ModelError, match=r"robot r exists already.*keep the robot that robot\(\) returned"):
        model.robot("r")


def test_counts_are_in_the_text_of_a_solution() -> None:
    model = robochoc.Model()
    x = model.robot("r").variable("x", range(1000))
    assert "1,000 solutions" in repr(model.solve("central", count=True))
    model.minimize(x // 500)
    with pytest.raises(robochoc.UnsupportedError, match="count-dpop' instead of central"):
        model.solve("central", count=True)
    assert "500 optima of cost 0" in repr(model.solve("count-dpop", count=True))


def test_mistakes_have_the_type_that_python_gives_such_ones() -> None:
    made = Made()
    with pytest.raises(TypeError):
        bool(made.x)
    with pytest.raises(KeyError):
        made.model["nobody"]
    assert issubclass(ModelTypeError, ValueError)
    assert issubclass(UnknownNameError, ValueError)


def test_variables_are_keys() -> None:
    made = Made()
    where = {made.x: 1, made.y: 2}
    assert where[made.y] == 2
    assert made.x in {made.x, made.y}
    assert stranger() not in where


def test_a_folder_that_is_there_is_replaced_on_demand(tmp_path: Path) -> None:
    made = Made()
    made.model.save(tmp_path / "team")
    with pytest.raises(InvalidInputError, match=r"the folder exists already .*save\(folder, replace=True\)"):
        made.model.save(tmp_path / "team")
    made.model.save(tmp_path / "team", replace=True)


def test_names_of_the_library_are_listed_and_guessed() -> None:
    assert {"Model", "load", "all_different", "journal"} <= {*dir(robochoc)}
    assert all(getattr(robochoc, name) is not None for name in dir(robochoc))
    with pytest.raises(AttributeError, match="did you mean 'all_different'"):
        _ = robochoc.all_diferent


def test_every_option_of_a_run_has_its_name() -> None:
    named = {*inspect.signature(robochoc.Problem.solve).parameters}
    assert {one.name for one in fields(Options)} - {"chosen", "stages"} <= named  # what the run has chosen


OPTIONS: list[tuple[dict[str, object], type[Exception], str]] = [
    ({"timout": 3}, TypeError, "did you mean 'timeout'"),
    ({"time_limit": 3}, TypeError, "did you mean 'timeout'"),
    ({"stop": lambda: True}, TypeError, r"stop=<.*expected a threading\.Event"),
    ({"progress": True}, TypeError, "progress=True is not allowed"),
    ({"runtime": "simulater"}, ValueError, "did you mean 'simulator'"),
    ({"order": "dom-dge"}, ValueError, "did you mean 'dom-deg'"),
    ({"order": ["a", "bb"]}, ValueError, "no robot 'bb'"),
    ({"withdraw": "some"}, ValueError, "expected minimum, maximal"),
    ({"on_loss": "withdrw"}, ValueError, "did you mean 'withdraw'"),
    ({"central_with": "ortool"}, ValueError, "did you mean 'ortools'"),
    ({"schedule": "rndom"}, ValueError, "did you mean 'random'"),
    ({"protocol": "dpopp"}, LookupError, "did you mean 'dpop'"),
]


@looped(("options", "kind", "says"), OPTIONS)
def test_options_that_there_are_not_are_guessed(options: dict[str, object], kind: type[Exception], says: str) -> None:
    with pytest.raises(kind, match=says):
        Made().model.solve(**options)  # type: ignore[arg-type]
