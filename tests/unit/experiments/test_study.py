"""A study's file: what it stands for, and what is wrong with it, with its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from robochoc.experiments.plan import TooManyRunsError, plan_of
from robochoc.experiments.study import read_study, study_of_tables
from robochoc.experiments.study_file import range_of
from robochoc.formats.diagnostics import InvalidInputError
from robochoc.formats.team_writer import write_team
from robochoc.generators.queens3d import queens3d
from tests.support.cases import cases
from tests.support.studies import COSTS, SMALL, study


def test_a_range_stands_for_its_numbers() -> None:
    with cases() as each:
        for text, numbers in [
            ("1..4", [1, 2, 3, 4]),
            ("-2..2:2", [-2, 0, 2]),
            ("0.1..0.4:0.1", [0.1, 0.2, 0.3, 0.4]),
            ("0.2..0.6:0.25", [0.2, 0.45]),
            ("0..1.0", [0.0, 1.0]),
            ("3..3", [3]),
            ("instances", None),
            ("1..", None),
            ("1...2", None),
            ("9" * 200, None),
        ]:
            with each(text):
                found = range_of(text)
                assert found == numbers
                assert found is None or [type(one) for one in found] == [type(one) for one in numbers or ()]


def test_a_range_without_values_or_with_too_many_is_refused() -> None:
    for text in ["4..1", "1..2:0", "1..2:-1", "0..1:0.000001"]:
        with pytest.raises(ValueError, match=r"has no value|has 1,000,001 values"):
            range_of(text)


def test_lists_and_ranges_stand_for_all_combinations() -> None:
    tasks = list(plan_of(study(SMALL)).values())
    assert [(t.problem.parameters["tightness"], t.problem.parameters["seed"], t.setup.protocol) for t in tasks] == [
        (tightness, seed, protocol) for tightness in (0.2, 0.5) for seed in (1, 2, 3) for protocol in ("abt", "afc-ng")
    ]


def test_ways_to_run_are_called_by_what_makes_them_differ() -> None:
    assert [setup.label for setup, _, _ in study(COSTS).setups] == [
        "sfb", "syncbb", "dsa variant=A", "dsa variant=B",
    ]  # fmt: skip
    more = SMALL + 'order = ["given", "dfs"]\nschedule = ["concurrent", "random"]\nruntime = "simulator"\n'
    assert [setup.label for setup, _, _ in study(more).setups][:4] == [
        "abt given concurrent", "abt given random", "abt dfs concurrent", "abt dfs random",
    ]  # fmt: skip
    several = SMALL.replace("[runs]", "[[runs]]") + '[[runs]]\nprotocol = "abt"\ndelay = 3\nsettings = {}\n'
    assert [setup.label for setup, _, _ in study(several).setups] == ["abt", "afc-ng", "abt delay=3"]
    assert study(SMALL.replace('["abt", "afc-ng"]', '"abt"\nlabel = "mine"')).setups[0][0].label == "mine"


def test_the_key_of_a_run_is_what_it_does_and_not_what_it_is_called(tmp_path: Path) -> None:
    keys = set(plan_of(study(SMALL)))
    renamed = SMALL.replace("[runs]", '[report]\nover = "seed"\n[limits]\n[runs]').replace(
        "domain", 'name = "x"\ndomain'
    )
    assert set(plan_of(study(f'title = "t"\n{renamed}'))) == keys
    for old, new in (("domain = 3", "domain = 4"), ("[runs]", "[runs]\ndelay = 3"), ("[runs]", "[runs]\nseed = 7")):
        assert not keys & set(plan_of(study(SMALL.replace(old, new))))
    assert not keys & set(plan_of(study(f"{SMALL}\n[limits]\nmessages = 50\n")))
    assert len(set(plan_of(study(f"repeat = 3\n{SMALL}"))) - keys) == 2 * len(keys)
    for folder in ("here", "there"):
        write_team(queens3d(2), tmp_path / folder / "team")
    files = [set(plan_of(study(_files(tmp_path / folder)))) for folder in ("here", "there")]
    assert files[0] == files[1]
    file = next((tmp_path / "there" / "team").glob("*.xml"))
    file.write_bytes(file.read_bytes() + b"\n")
    assert not files[0] & set(plan_of(study(_files(tmp_path / "there"))))


def _files(folder: Path) -> str:
    return f'[problems]\npath = "{folder}"\n[runs]\nprotocol = "abt"\n'


def test_paths_begin_at_the_study(tmp_path: Path) -> None:
    for size in (2, 3):
        write_team(queens3d(size), tmp_path / "teams" / f"queens-{size}")
    (tmp_path / "study.toml").write_text('[problems]\npath = "teams/queens-*"\n[runs]\nprotocol = "abt"\n')
    assert [one.parameters["instance"] for one in read_study(tmp_path / "study.toml").problems] == [
        "queens-2", "queens-3",
    ]  # fmt: skip


def test_a_study_of_tables_has_the_text_of_its_file() -> None:
    tables = {
        "problems": {"family": "random", "agents": [3, 4], "domain": 2, "density": 0.5, "tightness": 0.5},
        "runs": {"protocol": "dsa", "settings": {"cycles": 5}, "verify": False},
        "limits": {"timeout": 2.5},
    }
    found = study_of_tables("compare", tables)
    assert set(plan_of(study(found.text))) == set(plan_of(found))


WRONG = {
    "no file": (None, 0, "cannot be read"),
    "no TOML": ("[problems", 0, "is not a valid TOML file"),
    "no problems": ('[runs]\nprotocol = "abt"\n', 0, "problems: expected a table"),
    "no runs": (SMALL.partition("[runs]")[0], 0, "runs: expected a table"),
    "unknown table": (f"{SMALL}[limit]\n", 12, "limit: there is no such key (did you mean 'limits'?)"),
    "neither": (SMALL.replace('family = "random"\n', ""), 2, "either family (one of agentsnet,"),
    "unknown family": (SMALL.replace('"random"', '"randon"'), 3, "there is no family randon"),
    "unknown parameter": (SMALL.replace("domain", "domian"), 5, "did you mean 'domain'?"),
    "missing parameter": (SMALL.replace("domain = 3\n", ""), 2, "the family random needs domain"),
    "wrong type": (SMALL.replace("domain = 3", 'domain = "three"'), 5, "expected an integer, got 'three'"),
    "a truth for a number": (SMALL.replace("domain = 3", "domain = true"), 5, "expected an integer, got True"),
    "empty list": (SMALL.replace("[0.2, 0.5]", "[]"), 7, "expected at least one value"),
    "empty range": (SMALL.replace('"1..3"', '"3..1"'), 8, "has no value"),
    "table for a value": (SMALL.replace("[0.2, 0.5]", "{ a = 1 }"), 7, "expected numbers, words"),
    "unknown protocol": (SMALL.replace('"afc-ng"', '"afcng"'), 11, "no protocol 'afcng' is installed"),
    "no protocol": (f"{SMALL.partition('protocol')[0]}verify = true\n", 10, "protocol is missing"),
    "unknown runtime": (f'{SMALL}runtime = "threads"\n', 12, "expected processes, simulator, network, arrays"),
    "options apart": (
        f'{SMALL}runtime = "processes"\ndelay = 3\n',
        10,
        "--delay and --schedule are only for the simulator",
    ),
    "unknown setting": (f"{SMALL}settings = {{ cycles = 3 }}\n", 10, "--set:"),
    "unknown channel": (f'{SMALL}channel = "lan"\n', 0, "lan: is not a file"),
    "negative seed": (f"{SMALL}seed = -1\n", 12, "expected integers of 0 or more"),
    "limit of nothing": (f"{SMALL}[limits]\ntimeout = 0\n", 13, "expected more than 0"),
    "limit without end": (f"{SMALL}[limits]\ntimeout = inf\n", 13, "no more than 2^53, got inf"),
    "no number": (SMALL.replace("[0.2, 0.5]", "nan"), 7, "expected numbers, words"),
    "a number of many digits": (SMALL.replace("domain = 3", f"domain = 1{'0' * 30}"), 5, "expected numbers, words"),
    "a seed of many digits": (f"{SMALL}seed = 1{'0' * 30}\n", 12, "expected numbers, words"),
    "limit of words": (f'{SMALL}[limits]\ntimeout = "x"\n', 13, "limits: timeout: "),
    "limit below": (f"{SMALL}timeout = -2\n", 12, "expected more than 0"),
    "repeated never": (f"repeat = 0\n{SMALL}", 1, "expected an integer from 1 to 1,000"),
    "unknown recording": (f'record = ["cost"]\n{SMALL}', 1, "expected cost-over-time or robots or journal"),
    "no team there": ('[problems]\npath = "nothing-*"\n[runs]\nprotocol = "abt"\n', 2, "there is no team at nothing-*"),
    "option of files": (
        SMALL.replace("domain", "infinity = 3\ndomain"),
        5,
        "can only be used with files of other tools",
    ),
    "half a scenario": (SMALL.replace("domain", "scenario = { events = 2 }\ndomain"), 5, "rate is missing"),
    "label of several": (f'{SMALL}label = "x"\n', 12, "in a table with one way to run"),
    "wish for no metric": (
        f'{SMALL}[report]\nmetrics = ["costs"]\n',
        13,
        "there is no metric costs (did you mean 'cost'?",
    ),
    "wish over nothing": (f'{SMALL}[report]\nover = "tightnes"\n', 13, "did you mean 'tightness'?"),
    "wish for each run": (f'{SMALL}[report]\neach = "delay"\n', 13, "there is no parameter delay"),
    "too many settings": (
        SMALL.replace('["abt", "afc-ng"]', '"dsa"') + 'settings = { cycles = "1..1000", probability = "1..1000" }\n',
        12,
        "describes 1,000,000 combinations",
    ),
    "a range of many digits": (f'{SMALL}seed = "{10**19}..{10**19}"\n', 12, "expected numbers, words"),
    "a recording of a list": (f"record = [[1]]\n{SMALL}", 1, "expected cost-over-time or"),
    "a delay below": (f"{SMALL}delay = -1\n", 12, "expected 0 or more"),
    "too much memory": (f"{SMALL}[limits]\nmemory_mb = {2**50}\n", 13, "expected no more than"),
    "loads of arrays": (
        f'record = ["robots"]\n{SMALL}runtime = "arrays"\n'.replace('["abt", "afc-ng"]', '"dsa"'),
        1,
        "robots cannot be used with the runtime arrays, which sends no messages",
    ),
    "a title of two lines": (f'title = "a\\nb"\n{SMALL}', 1, "expected one line"),
    "a range with a dash": (SMALL.replace('"1..3"', '"1-3"'), 8, "a range is written 1..30"),
    "NCCCs of processes": (f'{SMALL}runtime = "processes"\nncccs = 3\n', 10, "--ncccs is only for the simulator"),
    "cycles of none": (f"{SMALL}cycles = 3\n", 10, "--cycles limits the cycles of the simulator"),
    "too narrow": (f"{SMALL}[report]\nwidth = 0.5\n", 13, "report: width: expected a number >= 2.0"),
    "unknown wish": (f'{SMALL}[report]\nabove = "x"\n', 13, "report: there is no field 'above'; did you mean 'over'?"),
}


def test_what_is_wrong_is_said_with_its_line(tmp_path: Path) -> None:
    with cases() as each:
        for name, (text, line, said) in WRONG.items():
            with each(name):
                path = tmp_path / "study.toml"
                if text is not None:
                    path.write_text(text)
                with pytest.raises(InvalidInputError) as caught:
                    read_study(path)
                assert said in str(caught.value)
                if line:
                    assert [one.line for one in caught.value.diagnostics] == [line]


def test_ways_that_are_called_alike_tell_their_protocols_and_limits() -> None:
    text = SMALL.partition("[runs]")[0]
    runs = '[[runs]]\nprotocol = "abt"\nlabel = "x"\n[[runs]]\nprotocol = "afc-ng"\nlabel = "x"\n'
    assert [setup.label for setup, *_ in study(text + runs).setups] == ["x abt", "x afc-ng"]
    runs = '[[runs]]\nprotocol = "abt"\n[[runs]]\nprotocol = "abt"\nmessages = 5\n'
    assert [setup.label for setup, *_ in study(text + runs).setups] == ["abt", "abt messages=5"]
    runs = '[[runs]]\nprotocol = "abt"\nlabel = "abt order"\n[[runs]]\nprotocol = "abt"\n[[runs]]\nprotocol = "abt"\n'
    assert [setup.label for setup, *_ in study(text + runs).setups] == ["abt order", "abt", "abt"]


def test_too_many_runs_are_refused() -> None:
    many = SMALL.replace('"1..3"', '"1..90000"').replace("[0.2, 0.5]", '"0..1.0:0.1"')
    with pytest.raises(InvalidInputError, match="at most 100,000 are allowed"):
        study(many)
    several = study(f"repeat = 1000\n{SMALL.replace('1..3', '1..300')}")
    with pytest.raises(TooManyRunsError, match="1,200,000 runs"):
        plan_of(several)
