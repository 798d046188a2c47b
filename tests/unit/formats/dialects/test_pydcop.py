"""pyDCOP's YAML, with its oddities, and what it must not do."""

from __future__ import annotations

import json
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest
import yaml

from robochoc.formats import InvalidInputError, check_team
from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.pydcop import python_function
from robochoc.formats.dialects.pydcop.owners import VariableOwners
from robochoc.formats.dialects.pydcop.python_function import PythonFunction
from robochoc.formats.dialects.registry import read_foreign
from robochoc.model.assembly import assemble
from robochoc.model.constraint import INFINITE, Constraint, Domain, Relation, Semantics, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import ProblemKind, RemoveAgent, Team
from robochoc.solver.errors import UnsupportedError
from tests.support.cases import looped
from tests.support.foreign_problems import imported, optimum, refused, written

HEAD = """name: small
objective: min
domains:
  colours: {values: [R, G]}
  few: {values: [0..2]}
  odd: {values: [0.5, yes]}
variables:
  x: {domain: few}
  y: {domain: few}
  c: {domain: colours, cost_function: -0.25 if c == 'G' else 0.5, noise_level: 0.2}
agents: [a1, a2]
constraints:
"""


def constraint(text: str) -> str:
    quoted = text if text.startswith("|") else json.dumps(text)
    return f"{HEAD}  k:\n    type: intention\n    function: {quoted}\n"


@looped(
    ("function", "best"),
    [
        ("0 if x != y else 10", 0),
        ("abs(x - y) + 2 * (x + y) - 3", -3),
        ("0.1 * x + 0.2 * y - 0.3", Fraction(-3, 10)),
        ("(0 if x + y == 3 else 1) + round(2.5)", 2),
        ("x ** 2 - max(x, y, 1) if c == 'R' else 5", -2),
        ("sum([v * 2 for v in [x, y] if v > 0]) - len('ab')", -2),
        ("{'R': 7, 'G': x}[c]", 0),
        ("10 * len({x, y}) + (3 if x in {y, 0} else 4) - x * y", 9),
        ("sum({x, y, 2}) if len({x, y, c}) == 2 else 9", 2),
        ("1 / (x + 1)", Fraction(333333333, 10**9)),
        ("|\n      b = 4\n      if x == 2:\n        b = b - y\n      return b", 2),
        ("|\n      t = 0\n      for i in range(x):\n        t += i - 1\n      return t", -1),
    ],
)
def test_functions_are_worth_what_python_says_but_exactly(function: str, best: Fraction, tmp_path: Path) -> None:
    team = imported(constraint(function), tmp_path, "a.yaml").team
    check_team(team)
    assert optimum(team) == best + (Fraction(1, 2) if function.startswith("x **") else Fraction(-1, 4))


def test_tables_owners_and_notes(tmp_path: Path) -> None:
    text = f"""{HEAD}  t:
    type: extensional
    variables: [c, x]
    default: 1
    values: {{-1.5: R 0 | G 2, 10000: G 0}}
  u:
    type: extensional
    variables: x
    values: {{2: 0 | 1, .inf: 2}}
distribution_hints: {{must_host: {{a2: [x]}}}}
"""
    found = imported(text, tmp_path, "a.yaml", infinity=10000)
    check_team(found.team)
    assert found.team.owner == {"y": "a1", "x": "a2", "c": "a1"}
    assert optimum(found.team) == Fraction(1, 2) - Fraction(3, 2) + 2
    assert {note.kind for note in found.notes} == {"owner", "dropped", "renamed"}


def test_hard_constraints_alone_are_a_discsp(tmp_path: Path) -> None:
    text = constraint("10000 if x == y else 0").replace(", cost_function: -0.25 if c == 'G' else 0.5", "")
    assert imported(text, tmp_path, "a.yaml", infinity=10000).team.kind == "DisCSP"


def test_distribution_and_scenario_are_files_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(constraint("x * y"))
    (tmp_path / "d.yaml").write_text("distribution: {a1: [x], a2: [y, c, k]}\n")
    (tmp_path / "s.yaml").write_text(
        "events:\n- {id: w, delay: 3}\n- {id: e, actions: [{type: remove_agent, agent: a2}]}\n"
    )
    found = read_foreign([tmp_path / name for name in ("a.yaml", "d.yaml", "s.yaml")], ImportOptions())
    assert found.team.owner == {"x": "a1", "y": "a2", "c": "a2"}
    assert [event.changes for event in found.team.scenario] == [(RemoveAgent("a2"),)]


LOOP = "|\n      a = 0\n      for i in range(99999):\n        "


def doubling(result: str) -> str:
    """Return the body of a function whose lists a and b have 2 ** 60 members, shared."""
    doubled = "      for i in range(60):\n        a = (a, a)\n        b = (b, b)\n"
    return f"|\n      a = (x,)\n      b = (x,)\n{doubled}      return {result}"


@looped(
    ("function", "message"),
    [
        ("__import__('os').system('true') + x", "the attribute '.system'"),
        ("eval('x')", "calls 'eval'"),
        ("x.__class__", "the attribute '.__class__'"),
        ("(lambda: x)()", "a call of this form"),
        ("9 ** 9 ** 9 ** 9 + x", "a power is too large"),
        ("|\n      import os\n      return x", "an import"),
        ("|\n      while x:\n        pass\n      return x", "While"),
        ("sum([i for i in range(100000) if sum([j for j in range(100000)])]) + x", "more than 100,000 steps"),
        ("'a' * 10 ** 9 + x", "is not a number"),
        (doubling("1 if a == b else x"), "more than 100000 members"),
        (doubling("{a: 1}[b]"), "more than 100000 members"),
        ("|\n      a = 0\n      for i in range(999):\n        a = [a]\n      return len({a: x})",
         "nested more than 50"),
        (f"{LOOP}a = len([1 for j in range(999) if x not in range(999)])\n      return x", "100,000 steps"),
        ("sum([1 / (3 ** 400 + i) for i in range(10000)]) + x", "a number is too large"),
        (f"len({{{', '.join(f'x+{i * (2**61 - 1)}' for i in range(2000))}}})", "too many members of a set or keys"),
        (LOOP + 999 * "a = a + x\n        " + "a = 0\n      return x", "more than 100,000 steps"),
        ("len(range(-10 ** 30, 10 ** 30)) + x", "a range is too long"),
        (f"{'(' * 500}x{')' * 500}", "function"),
        ("x / 0 + y", "has no value at x=0, y=0: ZeroDivisionError"),
        ("z + x", "'z', which is not a variable"),
        ("0 if {x, y} == {0, 1} else 1", "not allowed"),
        ("len({x, {y: 1}})", "a member of a set is a dictionary"),
    ],
)  # fmt: skip
def test_functions_that_are_refused(
    function: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(python_function, "MAX_STEPS", 100_000)
    assert message in refused(constraint(function), tmp_path, "a.yaml")


LAUGHS = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{after}: &{after} [{','.join([f'*{before}'] * 9)}]\n"
    for before, after in zip("abcdefgh", "bcdefghi", strict=True)
)


@looped(
    ("text", "message"),
    [
        (f"name: x\nobjective: min\n{LAUGHS}", "counting what aliases repeat"),
        ("variables: !!python/object/apply:os.system [x]\n", "the tag "),
        ("variables: !!binary aGk=\n", "the tag "),
        (f"variables: {'[' * 5000}", "nested"),
        ("variables: *nowhere\n", "alias"),
        ("variables: {x: {domain: d}\n", "is not YAML"),
        (
            "objective: best\nvariables: {}\n",
            "has the unknown objective 'best' (write objective: min, or objective: max)",
        ),
        ("objective: min\nvariables: {no: {domain: d}}\n", "expected a name, found 'False'"),
        ("objective: min\ndomains: {d: {values: [0..999999999]}}\nvariables: {x: {domain: d}}\n", "100000"),
    ],
)
def test_files_that_are_refused(text: str, message: str, tmp_path: Path) -> None:
    assert message in refused(text, tmp_path, "a.yaml")


def test_python_files_are_executed_only_where_that_is_allowed(tmp_path: Path) -> None:
    (tmp_path / "outside.py").write_text("def cost(a, b):\n    return 0.5 if a == b else -1\n")
    text = f"{HEAD}  k: {{type: intention, source: outside.py, function: 'source.cost(x, y)'}}\n"
    with pytest.raises(InvalidInputError, match="--allow-code"):
        imported(text, tmp_path, "a.yaml")
    assert optimum(imported(text, tmp_path, "a.yaml", allow_code=True).team) == Fraction(-5, 4)


WHOLE = """name: small
description: a problem
objective: min
domains:
  few: {values: [0..2], type: numbers}
variables:
  x: {domain: few, cost_function: 2 * x, noise_level: 0.2, initial_value: 1}
  y: {domain: few}
external_variables:
  e: {domain: few, initial_value: 1}
constraints:
  k: {type: intention, function: x + y + e}
  t: {type: extensional, variables: [x, y], default: 1, values: {2: 0 0}}
agents:
  a1: {capacity: 3}
  a2: {capacity: 4}
distribution_hints: {must_host: {a1: [x]}}
"""


def test_unknown_keys_are_refused_at_every_level(tmp_path: Path) -> None:
    imported(WHOLE, tmp_path, "a.yaml")
    for line, before, inside in (
        (1, "name:", ""),
        (5, "values: [0..2]", " in domains.few"),
        (7, "domain: few, cost", " in variables.x"),
        (10, "domain: few, initial_value: 1}\nc", " in external_variables.e"),
        (12, "type: int", " in constraints.k"),
        (13, "type: ext", " in constraints.t"),
        (17, "must_host", " in distribution_hints"),
    ):
        assert before in WHOLE
        sign = "\n" if before == "name:" else ", "
        said = refused(WHOLE.replace(before, f"zebra: 1{sign}{before}", 1), tmp_path, "a.yaml")
        assert said.startswith(f":{line}: unknown key 'zebra'{inside} (")


def test_values_of_another_kind_are_refused(tmp_path: Path) -> None:
    for now, then, message in (
        ("default: 1", "default: [1]", "has a default that is not a number"),
        ("domain: few}\ne", "domain: [few]}\ne", "has no domain, or an unknown one"),
        ("name: small", "name: {a: b}", "1: name: a mapping does not belong here"),
        (
            "values: {2: 0 0}",
            "valus: {2: 0 0}",
            "13: the constraint t: unknown key 'valus' in it (did you mean 'values'?)",
        ),
    ):
        assert now in WHOLE
        assert message in refused(WHOLE.replace(now, then, 1), tmp_path, "a.yaml")


def test_scenarios_and_distributions_are_strict_too(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(WHOLE)
    (tmp_path / "d.yaml").write_text(
        "inputs: {algo: dpop}\ncost: 3\nstatus: SUCCESS\ndistribution: {a1: [x], a2: [y]}\n"
    )
    (tmp_path / "s.yaml").write_text(
        "inputs: {by: hand}\nevents:\n- {id: w, delay: 3}\n- {id: e, actions: [{type: remove_agent, agent: a2}]}\n"
    )
    files = [tmp_path / name for name in ("a.yaml", "d.yaml", "s.yaml")]
    assert len(read_foreign(files, ImportOptions()).team.scenario) == 1
    for name, now, then in (
        ("d.yaml", "cost: 3", "costs: 3"),
        ("s.yaml", "delay: 3", "delays: 3, actions: []"),
        ("s.yaml", "agent: a2", "agent: a2, at: 3"),
    ):
        path = tmp_path / name
        text = path.read_text()
        assert now in text
        path.write_text(text.replace(now, then))
        with pytest.raises(InvalidInputError, match="unknown key"):
            read_foreign(files, ImportOptions())
        path.write_text(text)


def test_an_export_is_a_distribution_file_too() -> None:
    bit = Domain("bit", (range(2),))
    variables = {"a": [Variable("x", bit), Variable("y", bit)], "b": [Variable("z", bit)]}
    relation = Relation("r", 2, Semantics.SOFT, ((0, 0),), (5,), 1)
    names = ("c", "c", "c_2", "x", "constant")
    constraints = [Constraint(name, relation, ("x", "z"), ("x", "z")) for name in names]
    units = CostUnits(constant=3)
    team = assemble("t", variables, constraints, kind=ProblemKind.DISWCSP, costs=units)
    (content,) = written("pydcop", team).values()
    found = yaml.safe_load(content)
    assert found["distribution"] == {"a": ["x", "y"], "b": ["z"]} == found["distribution_hints"]["must_host"]
    assert all(agent["capacity"] > 1000 for agent in found["agents"].values())
    assert len({*found["constraints"], *found["variables"]}) == len(names) + 1 + len(team.variables)


def test_an_infinity_on_the_command_line_replaces_that_of_the_file(tmp_path: Path) -> None:
    text = "infinity: 7\n" + constraint("5 if x == y else 0")
    assert {note.kind for note in imported(text, tmp_path, "a.yaml").notes} >= {"infinity"}
    assert "infinity" not in {note.kind for note in imported(text, tmp_path, "a.yaml", infinity=5).notes}


def test_owners_that_an_option_replaces_may_stand_in_the_file(tmp_path: Path) -> None:
    text = f"{WHOLE}distribution: {{a1: [x], a2: [y]}}\n"
    assert imported(text, tmp_path, "a.yaml").team.owner == {"x": "a1", "y": "a2"}
    assert set(imported(text, tmp_path, "a.yaml", owner=".").team.owner.values()) == {"x", "y"}


def test_a_function_does_not_look_at_all_variables_of_the_problem() -> None:
    class Counted(dict[str, None]):
        looks = 0

        def __iter__(self) -> Iterator[str]:
            Counted.looks += 1
            return super().__iter__()

    variables = Counted.fromkeys(f"x{number}" for number in range(100))
    assert PythonFunction("x1 + 2 * x7", variables).scope == ("x1", "x7")
    assert Counted.looks == 0


def test_costs_that_dpop_of_pydcop_cannot_compare_are_refused() -> None:
    def team_of(cost: int, other: float) -> Team:
        relation = Relation("r", 1, Semantics.SOFT, ((0,),), (cost,), other)
        variables = {"a": [Variable("x", Domain("bit", (range(2),)))]}
        return assemble("t", variables, [Constraint("c", relation, ("x",), ("x",))], kind=ProblemKind.DISWCSP)

    assert written("pydcop", team_of(2**31 - 3, 0))
    assert written("pydcop", team_of(214_748_363, INFINITE))
    with pytest.raises(UnsupportedError, match="add up to 2,147,483,646: pyDCOP's costs are below 2,147,483,647"):
        written("pydcop", team_of(2**31 - 2, 0))
    with pytest.raises(UnsupportedError, match="add up to 214,748,364, and forbidden tuples cost ten times as much"):
        written("pydcop", team_of(214_748_364, INFINITE))


def test_variables_without_an_owner_go_to_the_agents_that_have_least() -> None:
    chance = Random("owners")
    for _ in range(200):
        agents = [f"a{number}" for number in range(chance.randint(1, 6))]
        variables = [f"v{number}" for number in range(chance.randint(0, 12))]
        owners = {name: chance.choice(agents) for name in variables if chance.random() < 0.4}
        hosting = VariableOwners(agents, variables, (), dict(owners))
        hosting.assign_remaining()
        for name in variables:
            if name not in owners:
                load = [list(owners.values()).count(agent) for agent in agents]
                owners[name] = agents[load.index(min(load))]
        assert hosting.owners == owners
