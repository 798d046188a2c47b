"""Options convert and check each of their values, whoever gives them; those that do not go together are refused."""

from __future__ import annotations

from dataclasses import fields
from enum import StrEnum
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import robochoc
from robochoc.communication.kill_schedule import Kill
from robochoc.communication.simulator.channel import CHANNELS
from robochoc.journal.entries import Header
from robochoc.journal.journal import JournalRecorder
from robochoc.journal.reader import read_journal
from robochoc.model.orders import Order
from robochoc.run import solve
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.options import CentralSolverName, OnLoss, Options, Preprocess, Runtime, ScheduleName, Withdrawal
from robochoc.solver.errors import UnsupportedError
from tests.support.cases import cases
from tests.support.refusals import costly_team, refusal_of

ENUMS: dict[str, type[StrEnum]] = {
    "runtime": Runtime,
    "withdraw": Withdrawal,
    "schedule": ScheduleName,
    "central_with": CentralSolverName,
    "on_loss": OnLoss,
    "preprocess": Preprocess,
    "order": Order,
}
NAMES = [one.name for one in fields(Options)]


def options(**given: Any) -> Options:  # noqa: ANN401 - of any type
    """Return options with values of any type."""
    return Options(**given)


def test_every_field_refuses_an_arbitrary_object_by_name() -> None:
    for name in NAMES:
        with pytest.raises((TypeError, ValueError), match=rf"^{name}=<object object .* is not allowed; "):
            options(**{name: object()})


def test_every_member_may_be_given_as_a_text() -> None:
    for name, choices in ENUMS.items():
        for member in choices:
            assert getattr(options(**{name: str(member)}), name) is member


def test_an_unknown_text_is_refused_with_the_nearest_name() -> None:
    for name, choices in ENUMS.items():
        with pytest.raises(ValueError, match=rf"^{name}='nonsense' is not allowed; expected {', '.join(choices)}$"):
            options(**{name: "nonsense"})
    with pytest.raises(ValueError, match=r"^withdraw='minimun' is not allowed; did you mean 'minimum'\?$"):
        options(withdraw="minimun")
    with pytest.raises(ValueError, match=r"^runtime='SIMULATOR' is not allowed; did you mean 'simulator'\?$"):
        options(runtime="SIMULATOR")


def test_numbers_of_other_libraries_become_pythons() -> None:
    for name in ("seed", "delay", "spares", "messages", "ncccs", "cycles"):
        value = getattr(options(**{name: np.int64(3)}), name)
        assert (type(value), value) == (int, 3)
    for name in ("timeout", "deadline", "improve", "patience", "message_loss"):
        for given in (np.float32(0.5), np.float64(0.5), Fraction(1, 2)):
            value = getattr(options(**{name: given}), name)
            assert (type(value), value) == (float, 0.5)
        assert getattr(options(**{name: np.int8(0)}), name) == 0
    for name in ("cache", "count", "verify", "bounds"):
        assert getattr(options(**{name: np.True_}), name) is True


def test_numbers_that_are_not_allowed() -> None:
    for name in ("delay", "spares", "messages", "ncccs", "cycles"):
        with pytest.raises(ValueError, match=f"^{name}=-1 is not allowed; expected 0 or more$"):
            options(**{name: -1})
    for name in ("timeout", "deadline", "improve", "patience"):
        for wrong in (-1, float("nan"), float("inf")):
            with pytest.raises(ValueError, match=f"^{name}=.* is not allowed; expected 0 or more seconds$"):
                options(**{name: wrong})
    for wrong in (-1, float("nan")):
        with pytest.raises(ValueError, match=r"^refine=.* is not allowed; expected a number of 0 or more$"):
            options(refine=wrong)
    for name in ("seed", "delay", "spares", "cache"):
        with pytest.raises(TypeError, match=f"^{name}=None is not allowed"):
            options(**{name: None})
    with pytest.raises(TypeError, match=r"^messages=2\.0 is not allowed; expected an integer$"):
        options(messages=2.0)


def test_lists_and_mappings_are_checked_by_item() -> None:
    made = options(
        protocol="ABT",
        order=["b", "a"],
        filters=["x"],
        settings={"cycles": 3},
        kill=[Kill("a", np.int64(1))],  # type: ignore[arg-type]
    )
    assert (made.protocol, made.order, made.filters) == ("abt", ("b", "a"), ("x",))
    assert (made.settings, made.kill) == ({"cycles": "3"}, (Kill("a", 1.0),))
    for name, wrong, told in (
        ("order", ["a", 3], r"order\[1\]=3"),
        ("filters", "ab", "filters='ab'"),
        ("kill", ["a"], r"kill\[0\]='a' is not allowed; expected a Kill\(robot, after_s\)"),
        ("settings", ["a"], "settings="),
    ):
        with pytest.raises(TypeError, match=f"^{told}"):
            options(**{name: wrong})
    with pytest.raises(ValueError, match=r"^kill\[0\].after_s=-1.0 is not allowed; expected 0 or more seconds$"):
        options(kill=(Kill("a", -1),))


def star() -> robochoc.Model:
    """Return a hub with one value that none of its leaves may have, which have no other."""
    model = robochoc.Model("star")
    hub, *leaves = [model.robot(name).variable("x", [0]) for name in ("hub", "l0", "l1", "l2", "l3")]
    model.add([hub != leaf for leaf in leaves])
    return model


def test_texts_mean_the_same_wherever_options_are_given() -> None:
    made = options(protocol="abt", runtime="simulator", withdraw="minimum")
    outcome = solve(star().team, made)
    assert (outcome.withdrawn, outcome.verdict) == (("hub",), "optimal")
    assert star().solve("abt", "simulator", withdraw="minimum").withdrawn == ("hub",)
    assert star().solve("ABT", "simulator", withdraw="maximal").withdrawn == ("l0", "l1", "l2", "l3")


def test_options_of_problems_as_arrays_are_converted() -> None:
    problem = robochoc.ArrayProblem(2, 2, [(0, 1)], [[1, 0], [0, 1]])
    assert problem.solve("DSA", seed=np.int64(1), timeout=np.float32(60)).cost == 0  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"^timeout=-1.0 is not allowed; expected 0 or more seconds$"):
        problem.solve(timeout=-1)
    with pytest.raises(TypeError, match=r"^seed=None is not allowed; expected an integer$"):
        problem.solve(seed=None)  # type: ignore[arg-type]


# Options that do not go together are refused, whatever the problem is


WLAN = CHANNELS["wlan"]
REFUSED_OPTIONS: list[tuple[dict[str, Any], str]] = [
    (
        {"runtime": Runtime.ARRAYS},
        "sfb has no array implementation; add --runtime simulator, or choose a protocol",
    ),
    (
        {"runtime": Runtime.ARRAYS, "protocol": "dsa", "withdraw": Withdrawal.MAXIMAL},
        "--withdraw cannot be used with --runtime arrays",
    ),
    ({"runtime": Runtime.SIMULATOR, "cluster": "tcp://x:1"}, "--cluster is only for --runtime arrays"),
    ({"runtime": Runtime.ARRAYS, "cluster": "tcp://x:1", "deadline": 2.0}, "use --timeout"),
    ({"runtime": Runtime.ARRAYS, "protocol": "mgm2", "cluster": "tcp://x:1"}, "MGM2 cannot run on a cluster"),
    ({"runtime": Runtime.ARRAYS, "delay": 3}, "--delay and --schedule are only for the simulator"),
    ({"runtime": Runtime.ARRAYS, "ncccs": 3}, "--ncccs is only for the simulator"),
    ({"runtime": Runtime.ARRAYS, "patience": 3.0}, "--patience is only for robots that run as processes"),
    ({"runtime": Runtime.ARRAYS, "spares": 1}, "--on-loss and --spare are only for robots"),
    ({"runtime": Runtime.ARRAYS, "kill": (Kill("RA", 1),)}, "the simulator and arrays do not use processes"),
    ({"runtime": Runtime.ARRAYS, "filters": ("signed",)}, "--filter is only for messages over a network"),
    ({"channel": WLAN, "runtime": Runtime.PROCESSES}, "add --runtime simulator"),
    ({"channel": WLAN, "delay": 3}, "remove --delay and --schedule"),
    ({"delay": 3, "runtime": Runtime.PROCESSES}, "--delay and --schedule are only for the simulator"),
    ({"delay": 3, "schedule": ScheduleName.RANDOM}, "--delay is only for --schedule concurrent"),
    ({"protocol": "central", "verify": True, "count": True}, "--verify confirms a no-solution or an optimum"),
    ({"patience": 1.0}, "--patience is only for robots that run as processes"),
    ({"protocol": "central", "messages": 5}, "--messages is for robots"),
    ({"protocol": "central", "order": ("RA", "RB")}, "--order is for robots"),
    ({"protocol": "central", "settings": {"cycles": "5"}}, "--set is for robots"),
    ({"protocol": "central", "withdraw": Withdrawal.MAXIMAL}, "use --withdraw minimum"),
    ({"protocol": "central", "count": True, "withdraw": Withdrawal.MINIMUM}, "cannot be used with --withdraw"),
    ({"filters": ("signed",)}, "add --runtime network"),
    ({"spares": 1, "runtime": Runtime.NETWORK}, "remove --runtime network"),
    ({"on_loss": OnLoss.WITHDRAW}, "are only for robots that run as processes"),
    ({"spares": 1, "on_loss": OnLoss.FAIL, "runtime": Runtime.PROCESSES}, "cannot be used with --on-loss fail"),
]


def test_options_that_do_not_go_together_are_refused_in_python_too() -> None:
    with cases() as each:
        for options, said in REFUSED_OPTIONS:
            with each(said):
                assert said in refusal_of(
                    costly_team(3), Options(**{"protocol": "sfb", "runtime": Runtime.SIMULATOR, **options})
                )


def test_no_rule_refuses_the_defaults() -> None:
    for runtime in Runtime:
        refuse_options(Options(runtime=runtime), environment=runtime not in {Runtime.NETWORK, Runtime.ARRAYS})
    refuse_options(Options(protocol="central", count=True))


def test_a_seed_has_64_bits_as_journals_and_networks_tell_it() -> None:
    for seed in [2**64, -(2**63) - 1]:
        with pytest.raises(UnsupportedError, match="--seed must be a 64-bit number"):
            refuse_options(Options(seed=seed))


def test_the_largest_seeds_can_be_recorded() -> None:
    for seed in [2**64 - 1, -(2**63)]:
        refuse_options(Options(seed=seed))
        recorder = JournalRecorder(Header(team="team", protocol="abt", runtime="simulator", seed=seed))
        recorder.flush()
        assert read_journal(recorder.content()).header.seed == seed
