"""Options that do not go together are refused, whatever the problem is."""

from __future__ import annotations

from typing import Any

import pytest

from robochoc.communication.kill_schedule import Kill
from robochoc.communication.simulator.channel import CHANNELS
from robochoc.journal.entries import Header
from robochoc.journal.journal import JournalRecorder
from robochoc.journal.reader import read_journal
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.options import OnLoss, Options, Runtime, ScheduleName, Withdrawal
from robochoc.solver.encoding import UnsupportedError
from tests.support.cases import cases
from tests.support.refusals import costly_team, refusal_of

WLAN = CHANNELS["wlan"]
REFUSED_OPTIONS: list[tuple[dict[str, Any], str]] = [
    ({"runtime": Runtime.ARRAYS}, "sfb has no form as arrays; add --runtime simulator, or choose a protocol"),
    ({"runtime": Runtime.ARRAYS, "protocol": "dsa", "withdraw": Withdrawal.MAXIMAL}, "--withdraw is settled by"),
    ({"runtime": Runtime.ARRAYS, "delay": 3}, "--delay and --schedule are the simulator's"),
    ({"runtime": Runtime.ARRAYS, "ncccs": 3}, "--ncccs is a limit for the simulator"),
    ({"runtime": Runtime.ARRAYS, "patience": 3.0}, "--patience is for robots with processes"),
    ({"runtime": Runtime.ARRAYS, "spares": 1}, "--on-loss and --spare are for processes, which can die"),
    ({"runtime": Runtime.ARRAYS, "kill": (Kill("RA", 1),)}, "the simulator and arrays have none"),
    ({"runtime": Runtime.ARRAYS, "filters": ("signed",)}, "--filter is for messages that cross a network"),
    ({"channel": WLAN, "runtime": Runtime.PROCESSES}, "add --runtime simulator"),
    ({"channel": WLAN, "delay": 3}, "drop --delay and --schedule"),
    ({"delay": 3, "runtime": Runtime.PROCESSES}, "--delay and --schedule are the simulator's"),
    ({"delay": 3, "schedule": ScheduleName.RANDOM}, "--delay is for --schedule concurrent"),
    ({"protocol": "central", "verify": True}, "--verify asks the central solver"),
    ({"patience": 1.0}, "--patience is for robots with processes"),
    ({"protocol": "central", "messages": 5}, "--messages is for robots"),
    ({"protocol": "central", "order": ("RA", "RB")}, "--order is for robots"),
    ({"protocol": "central", "settings": {"cycles": "5"}}, "--set is for robots"),
    ({"protocol": "central", "withdraw": Withdrawal.MAXIMAL}, "finds a minimum; --withdraw minimum"),
    ({"protocol": "central", "count": True, "withdraw": Withdrawal.MINIMUM}, "who can do without"),
    ({"filters": ("signed",)}, "add --runtime network"),
    ({"spares": 1, "runtime": Runtime.NETWORK}, "drop --runtime network"),
    ({"on_loss": OnLoss.WITHDRAW}, "for processes, which can die"),
    ({"spares": 1, "on_loss": OnLoss.FAIL, "runtime": Runtime.PROCESSES}, "--on-loss fail ends the run instead"),
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
        with pytest.raises(UnsupportedError, match="--seed is a number of 64 bits"):
            refuse_options(Options(seed=seed))


def test_the_largest_seeds_can_be_recorded() -> None:
    for seed in [2**64 - 1, -(2**63)]:
        refuse_options(Options(seed=seed))
        recorder = JournalRecorder(Header(team="team", protocol="abt", runtime="simulator", seed=seed))
        recorder.flush()
        assert read_journal(recorder.content()).header.seed == seed
