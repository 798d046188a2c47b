"""Programs that only read from the leading master find it among several."""

from __future__ import annotations

import socket

import pytest

from robochoc.communication.network.transport import CannotConnectError
from robochoc.run.networked.address import Address
from robochoc.run.networked.directory_query import NoAnswerError
from robochoc.run.networked.leader_search import at_leader
from tests.support.ports import LOOPBACK, free_port


def silent(place: Address) -> Address:
    raise NoAnswerError(f"no answer from {place}")


def test_a_single_master_is_asked_even_if_it_does_not_listen() -> None:
    nobody = Address(LOOPBACK, free_port(LOOPBACK))
    assert at_leader([nobody], 0, lambda place: place) == nobody


def test_the_first_master_that_listens_and_answers_is_asked() -> None:
    nobody = Address(LOOPBACK, free_port(LOOPBACK))
    with socket.create_server((LOOPBACK, 0)) as first, socket.create_server((LOOPBACK, 0)) as second:
        places = [nobody, *(Address(LOOPBACK, one.getsockname()[1]) for one in (first, second))]
        assert at_leader(places, 0, lambda place: place) == places[1]
        assert at_leader(places, 0, lambda place: silent(place) if place == places[1] else place) == places[2]
        with pytest.raises(NoAnswerError, match=f"no answer from {places[2]}"):
            at_leader(places, 0, silent)


def test_no_master_listens() -> None:
    places = [Address(LOOPBACK, free_port(LOOPBACK)), Address(LOOPBACK, 1)]
    with pytest.raises(CannotConnectError, match=f"no master leads: none of {places[0]}, {places[1]} listened for 0 s"):
        at_leader(places, 0, lambda place: place)
