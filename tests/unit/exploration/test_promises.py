"""The promises of incomplete protocols hold in every order of deliveries, and each broken promise is found."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import pytest

from robochoc.exploration.check import CheckOptions, checked
from robochoc.exploration.problems import small_teams
from robochoc.protocols.auctions.ssi import SSI
from robochoc.protocols.inference.bounded_maxsum import BoundedMaxSum
from robochoc.protocols.local_search.kopt import KOpt
from robochoc.protocols.local_search.mgm import MGM, Gain
from robochoc.protocols.local_search.mgm2 import MGM2
from robochoc.protocols.message import Message
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.shared.cycles import NO_GAIN
from robochoc.run import Options, Runtime
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.compiled import plain_python_only
from tests.support.examples import count

pytestmark = plain_python_only

PROMISING = [
    name
    for name in protocol_names()
    if (traits := protocol_named(name).traits).cost_never_rises
    or traits.optimal_groups
    or traits.share_of_optimum
    or name == "bounded-maxsum"
]


def faults(
    protocol: type[Protocol], teams: int, settings: Mapping[str, str] | None = None, losses: int = 0
) -> Iterator[str]:
    """Yield the faults in some of `teams`."""
    short = {"cycles": "2"} if hasattr(protocol.settings, "cycles") else {}
    run = Options(protocol=protocol.__name__, runtime=Runtime.SIMULATOR, settings={**short, **(settings or {})})
    problems = itertools.islice(small_teams(protocol.traits, 3, 3, 5), teams)
    options = CheckOptions(protocol, run, states=500, losses=losses)
    return (one.exploration.fault for one in checked(problems, options) if one.exploration.fault)


@pytest.mark.parametrize("name", PROMISING)
@count("teams", fast=5, slow=100)
def test_promises_hold(name: str, teams: int) -> None:
    assert not [*faults(protocol_named(name), teams)]


def test_there_are_promises() -> None:
    assert {*PROMISING} >= {"mgm", "mgm2", "kopt", "lamdls", "ssi", "cbaa", "cbba", "bounded-maxsum"}


class EqualGainsMove(MGM):
    """Lets all neighbours with the largest gain move."""

    def wins(self, gains: Mapping[str, Message]) -> bool:
        others = [(one.broken, one.cost) for one in gains.values() if isinstance(one, Gain)]
        return self.gain > NO_GAIN and all(self.gain >= other for other in others)


class AllMove(MGM):
    """Ignores the gains of others."""

    def wins(self, gains: Mapping[str, Message]) -> bool:
        del gains
        return self.gain > NO_GAIN


class OldValues(MGM):
    """Uses the neighbours' values of the cycle before."""

    before: Mapping[str, Any] | None = None

    def best_unilateral(self, view: Mapping[str, Any]) -> None:
        super().best_unilateral(self.before or view)
        self.before = view


class BothGo(MGM2):
    """Makes a joint move although the partner does not allow it."""

    def _receive_go(self, messages: Mapping[str, Message]) -> None:
        del messages
        self._end_cycle(move=self._wins)


@pytest.mark.parametrize("mutant", [EqualGainsMove, AllMove, OldValues, BothGo])
def test_a_rising_cost_is_found(mutant: type[Protocol]) -> None:
    assert any("it must never rise" in fault for fault in faults(mutant, 60))


class NeverMoves(MGM):
    """Keeps its first value."""

    def wins(self, gains: Mapping[str, Message]) -> bool:
        del gains
        return False


class TooSmallGroups(KOpt):
    """Promises more than the size of its groups, if `k` is 1."""

    traits = replace(KOpt.traits, optimal_groups=2)


@pytest.mark.parametrize("mutant", [NeverMoves, TooSmallGroups])
def test_an_end_that_is_no_local_optimum_is_found(mutant: type[Protocol]) -> None:
    settings = {"k": "1"} if mutant is TooSmallGroups else {}
    assert any("could lower the cost" in fault for fault in faults(mutant, 30, settings))


class NoCuts(BoundedMaxSum):
    """Reports no cuts."""

    @property
    def most_above_bound(self) -> float | None:
        return None if self.optimum is None else 0


def test_an_error_above_the_announced_one_is_found() -> None:
    assert any("above the bound" in fault for fault in faults(NoCuts, 60))


class NoBids(SSI):
    """Never bids."""

    def _bid(self) -> None:
        self.offer = None


def test_a_low_profit_is_found() -> None:
    assert any("of the maximum" in fault for fault in faults(NoBids, 20))


def test_a_rising_cost_after_a_loss_is_no_fault() -> None:
    assert not [*faults(EqualGainsMove, 5, losses=1)]
