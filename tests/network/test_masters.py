"""How robots look for another master, and how they and the masters vote."""

from __future__ import annotations

import stat
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from robochoc.authority.admission import InMemoryAuthority
from robochoc.authority.registry import Right, Role, locked
from robochoc.communication.network.control_messages import (
    Accepted,
    AcceptedDecision,
    Lead,
    Promised,
    Propose,
    Register,
    RegistrationDenied,
    StandbyAnswer,
    StandbyRequest,
    Standing,
    TeamDecision,
    Welcome,
)
from robochoc.communication.network.framing import MASTER, Framing
from robochoc.communication.network.leadership import NO_TERM, Term
from robochoc.communication.network.master import Master
from robochoc.communication.network.master_votes import MasterVotes, NoMajorityError, SupersededError
from robochoc.communication.network.masters import SILENCE_S, Masters
from robochoc.communication.network.members import Member, NetworkMembers
from robochoc.communication.network.robot_votes import KEPT_S, RobotVotes, VotesError
from robochoc.communication.network.standbys import CopiedAdmission, Standbys
from robochoc.run.networked.address import Address
from robochoc.run.networked.standby import LeaderWatch, NoLeaderError, StandbyPlan
from tests.support.deployments import TRIANGLE
from tests.support.ports import LOOPBACK, free_port
from tests.support.sparse_teams import profiles_of

A, B, C = (f"127.0.0.1:{port}" for port in (7447, 7457, 7467))
FIRST, SECOND = Term(1, "a"), Term(2, "b")
DECISION = TeamDecision("a", ("RA", "RB"), "{}", "solution")
TEAM = ("RA", "RB", "RC")


class Site:
    """A clock, and the addresses that listen."""

    def __init__(self, *listening: str) -> None:
        self.now = 0.0
        self.listening = set(listening)

    def masters(self, *endpoints: str, patience_s: float = 30) -> Masters:
        return Masters(endpoints, patience_s, lambda: self.now, self.listening.__contains__, self._sleep)

    def _sleep(self, seconds: float) -> None:
        self.now += seconds


def test_a_robot_looks_for_another_master_if_its_own_is_silent() -> None:
    site = Site(A, C)
    masters = site.masters(A, B, C)
    site.now = SILENCE_S - 0.1
    assert not masters.other_listens()
    masters.hear()
    site.now += SILENCE_S
    assert masters.other_listens()
    assert masters.current == C
    masters.leave()
    assert masters.current == C, "it has moved already"


def test_a_stopped_master_that_listens_hides_no_other() -> None:
    site = Site(A, B, C)
    masters = site.masters(A, B, C)
    tried = []
    for _ in range(4):
        masters.leave()
        tried.append(masters.current)
    assert tried == [B, C, A, B]


def test_a_robot_returns_to_its_master_if_no_other_listens() -> None:
    site = Site(A)
    masters = site.masters(A, B)
    masters.leave()
    assert (masters.current, masters.is_over) == (A, False)


def test_the_patience_of_a_robot_ends() -> None:
    site = Site()
    masters = site.masters(A, B, patience_s=5)
    masters.note_refusal("no")
    masters.leave()
    assert masters.is_over
    assert masters.failure == f"no master leads: none of {A}, {B} did for 5 s (the last answer: no)"
    assert site.now < 6


def test_a_single_master_is_not_watched() -> None:
    site = Site(A)
    masters = site.masters(A)
    site.now = 1000
    assert (masters.several, masters.is_over, masters.other_listens()) == (False, False, False)
    assert masters.attempt_s == 30


# Votes of robots


def test_votes_outlast_the_process(tmp_path: Path) -> None:
    file = tmp_path / "votes.json"
    robot = RobotVotes(file, several=True)
    assert robot.standing == Standing()
    robot.remember("a", {"X": 1})
    order = Lead(FIRST, "m", TEAM)
    assert robot.promise(order, private=False) == Promised(FIRST, FIRST, None, {"a": {"X": 1}})
    assert robot.standing == Standing("m", TEAM, FIRST)
    assert robot.accept(Propose(FIRST, DECISION)) == Accepted(FIRST, FIRST)
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    again = RobotVotes(file, several=True)
    assert again.standing == Standing(), "only the master knows whether the mission goes on"
    accepted = AcceptedDecision(FIRST, DECISION)
    assert again.promise(Lead(SECOND, "m", TEAM), private=True) == Promised(SECOND, SECOND, accepted, {})
    assert (again.decided("RA"), again.decided("RC")) == ({"X": 1}, {}), "RC was lost"
    again.remember("b", {"X": 2})
    assert again.decided("RA") == {"X": 1}, "found in another run"
    assert again.accept(Propose(FIRST, DECISION)) == Accepted(FIRST, SECOND)
    assert again.promise(Lead(FIRST, "m", TEAM), private=True).promised == SECOND


def test_votes_of_another_mission_do_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "votes.json"
    RobotVotes(file).promise(Lead(SECOND, "m", TEAM), private=False)
    assert RobotVotes(file).promise(Lead(FIRST, "n", TEAM), private=False).promised == FIRST
    assert RobotVotes(file).promise(Lead(FIRST, "m", TEAM), private=False).promised == SECOND
    monkeypatch.setattr("time.time", lambda: 1e10)
    RobotVotes(file).promise(Lead(FIRST, "o", TEAM), private=False)
    assert '"m":' not in file.read_text(), f"votes are stored for {KEPT_S:g} s"


def test_votes_that_cannot_be_stored_are_not_sent(tmp_path: Path) -> None:
    damaged, folder = tmp_path / "votes.json", tmp_path / "folder"
    damaged.write_text("{")
    folder.mkdir()
    for file, why in ((damaged, "is damaged"), (folder, "cannot be read")):
        with pytest.raises(VotesError, match=why):
            RobotVotes(file).promise(Lead(FIRST, "m", TEAM), private=False)


def test_two_processes_of_a_robot_have_common_votes(tmp_path: Path) -> None:
    first, second = (RobotVotes(tmp_path / "votes.json", several=True) for _ in range(2))
    assert first.promise(Lead(FIRST, "m", TEAM), private=False).promised == FIRST
    assert second.promise(Lead(SECOND, "m", TEAM), private=False).promised == SECOND
    assert first.accept(Propose(FIRST, DECISION)) == Accepted(FIRST, SECOND), "the other process votes for another one"
    assert second.accept(Propose(SECOND, DECISION)) == Accepted(SECOND, SECOND)
    accepted = AcceptedDecision(SECOND, DECISION)
    assert first.promise(Lead(SECOND, "m", TEAM), private=True) == Promised(SECOND, SECOND, accepted, {})


def test_a_process_that_locks_the_votes_does_not_stop_another_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robochoc.communication.network.robot_votes.LOCKED_S", 0.05)
    with locked(tmp_path), pytest.raises(VotesError, match=r"another process of this robot has locked it for 0\.05 s"):
        RobotVotes(tmp_path / "votes.json").promise(Lead(FIRST, "m", TEAM), private=False)
    RobotVotes(tmp_path / "votes.json").promise(Lead(FIRST, "m", TEAM), private=False)


# Votes for a master


def test_a_master_counts_votes() -> None:
    votes = MasterVotes("a", "MASTER")
    assert (votes.admit(None, closed=False), votes.is_needed, votes.term) == ("", False, None)
    votes.check_majority([])
    assert votes.admit(Standing(), closed=False) == ""
    assert votes.is_needed
    assert votes.start(TEAM) == Lead(FIRST, "a", TEAM)
    for name in ("RA", "RB"):
        with pytest.raises(NoMajorityError, match="of 3 robots are for this master, and a decision needs 2"):
            votes.check_promises()
        assert votes.note(name, Promised(FIRST, FIRST, None, {})) == ""
    votes.check_promises()
    assert votes.inherited is None
    assert votes.propose(DECISION) == Propose(FIRST, DECISION)
    assert votes.note("RA", Accepted(FIRST, FIRST)) == ""
    with pytest.raises(NoMajorityError, match=r"1 of 3 robots are for the decision.*missing: RB, RC"):
        votes.check_acceptances()
    assert votes.note("RB", Accepted(FIRST, SECOND)) == "it has voted for another master in term 2"
    assert votes.note("RB", Accepted(SECOND, SECOND)) == "it has voted in a term that this master did not ask for"
    assert votes.note("RC", Accepted(FIRST, FIRST)) == ""
    votes.check_acceptances()
    with pytest.raises(NoMajorityError, match="1 of 3 robots are connected"):
        votes.check_majority(["RA", "stranger"])


def test_a_later_master_learns_the_mission_from_robots() -> None:
    votes = MasterVotes("b", "B")
    assert votes.admit(Standing("m", TEAM, FIRST), closed=False) == ""
    assert (votes.mission, votes.team, votes.is_takeover) == ("m", TEAM, True)
    assert "another master has started" in votes.admit(Standing("n", TEAM, FIRST), closed=False)
    assert votes.start(["RA", "RB"]) == Lead(SECOND, "m", TEAM)
    accepted = AcceptedDecision(FIRST, DECISION)
    votes.note("RA", Promised(SECOND, SECOND, accepted, {"a": {"X": 1}}))
    votes.note("RB", Promised(SECOND, SECOND, None, {"a": {"Y": 2}, "c": {"Y": 3}}))
    assert votes.inherited == DECISION
    assert votes.decided_values(DECISION) == {"RA": {"X": 1}, "RB": {"Y": 2}}
    assert votes.last_values == {"RA": {"X": 1}, "RB": {"Y": 3}}
    assert votes.propose(TeamDecision("b", (), "", "unknown")) == Propose(SECOND, DECISION)


def test_a_closed_team_admits_no_robots_of_another() -> None:
    assert MasterVotes("a", "MASTER").admit(Standing("m", TEAM, FIRST), closed=True)
    assert NO_TERM < FIRST


def test_an_impossible_term_does_not_stop_later_masters() -> None:
    votes = MasterVotes("a", "MASTER")
    assert "which no master can have reached" in votes.admit(Standing("", (), Term(2**64 - 1, "x")), closed=False)
    assert votes.start(TEAM).term == FIRST


# Standby masters


def test_a_standby_master_receives_the_rules_of_the_authority() -> None:
    sent: list[StandbyAnswer] = []
    names = {Role.MASTER: ("MASTER", "B")}

    class WithMasters(InMemoryAuthority):
        def names(
            self, role: Role | None = None, right: Right | None = None, *, invited: bool = False
        ) -> tuple[str, ...]:
            return names[role] if role in names else super().names(role, right, invited=invited)

        def is_revoked(self, who: str | int) -> bool:
            return who not in {"MASTER", "B"} and super().is_revoked(who)

    with_masters = WithMasters(TEAM)
    with_masters.enrol("RA", sniffs=True)
    standbys = Standbys(with_masters, lambda _name, answer: sent.append(answer))
    standbys.answer("RA", StandbyRequest())
    assert not sent, "it is a robot"
    standbys.answer("B", StandbyRequest())
    copy = CopiedAdmission(sent[0])
    assert copy.names(Role.ROBOT) == TEAM
    assert copy.names(Role.MASTER) == ("B", "MASTER")
    assert copy.names(right=Right.SNIFF) == ("RA",)
    assert (copy.is_revoked("RA"), copy.is_revoked("X")) == (False, True)
    standbys.end("solution", failed=False)
    assert (sent[1].over, sent[1].failed, standbys.waiting) == ("solution", False, {"B"})
    standbys.answer("B", StandbyRequest(over=True))
    assert not standbys.waiting
    standbys.answer("B", StandbyRequest())
    standbys.resign()
    assert (sent[-1].resigned, standbys.waiting) == (True, set())
    standbys.answer("B", StandbyRequest())
    assert not standbys.waiting


def watch_of(folder: Path, *leaders: Address) -> LeaderWatch:
    authority = InMemoryAuthority(TEAM)
    identity = replace(authority.master_identity((LOOPBACK,)), folder=folder)
    return LeaderWatch(StandbyPlan(leaders, identity))


def test_a_new_standby_master_waits_for_an_answer(tmp_path: Path) -> None:
    place = Address(LOOPBACK, free_port(LOOPBACK))
    with watch_of(tmp_path, place) as watch, pytest.raises(NoLeaderError, match=f"no answer from {place} for 0.1 s"):
        watch.wait(0.1)


def test_standby_masters_follow_a_master_that_has_resigned_one_by_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robochoc.run.networked.standby.time", SimpleNamespace(monotonic=lambda: 100.0))
    first = Address(LOOPBACK, free_port(LOOPBACK))
    answer = StandbyAnswer({}, (), resigned=True, closed=True)
    for leaders, wait_s in (((first,), 0.0), ((first, Address(LOOPBACK, 1)), 1.0)):
        watch = watch_of(tmp_path, *leaders)
        watch._began = 0.0  # noqa: SLF001 - no threads
        watch._note(first, answer)  # noqa: SLF001 - no threads
        assert (watch.is_led, watch.has_closed) == (False, True)
        assert watch.wait_s - watch._silent_s() == wait_s  # noqa: SLF001 - no threads


# A master whose robots have left


def test_a_master_ends_its_term_if_a_robot_has_left_it_and_returns() -> None:
    authority = InMemoryAuthority(TEAM)
    members = NetworkMembers()
    master = Master(authority, authority.master_identity((LOOPBACK,)), f"{LOOPBACK}:7447", members)
    profile = profiles_of(TRIANGLE)["RA"]
    members.robots["RA"] = Member(profile, "first", joined=True)
    members.closed = True
    master.votes.admit(Standing(), closed=False)
    mission = master.votes.start(TEAM).mission
    sent: list[object] = []
    framing = Framing("RA")

    def register(incarnation: str, standing: Standing | None) -> None:
        master._read("RA", framing.write(MASTER, Register(profile, incarnation, standing)))  # noqa: SLF001 - no network

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(master._connection, "send", lambda _name, message: sent.append(message))  # noqa: SLF001
        register("first", Standing(mission, TEAM, FIRST))
        register("second", Standing())
        register("second", None)
        assert [type(message) for message in sent] == [Welcome, RegistrationDenied, RegistrationDenied]
        with pytest.raises(NoMajorityError, match="RA has left this master for another one"):
            register("second", Standing(mission, TEAM, FIRST))


def test_a_master_to_which_no_robot_comes_after_a_takeover(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.communication.network.master.COMING_S", 0)
    authority = InMemoryAuthority(TEAM)
    master = Master(authority, authority.master_identity((LOOPBACK,)), f"{LOOPBACK}:7447", NetworkMembers())
    assert not master.gather(deadline=0.0)
    master.takes_over = True
    with pytest.raises(NoMajorityError, match="no robot has come to this master for 0 s: its run has ended elsewhere"):
        master.gather()


def test_a_master_steps_down_only_without_robots_of_an_earlier_run() -> None:
    authority = InMemoryAuthority(TEAM)
    master = Master(authority, authority.master_identity((LOOPBACK,)), f"{LOOPBACK}:7447", NetworkMembers())
    master.is_superseded = lambda: True
    with pytest.raises(SupersededError):
        master.gather()
    master.votes.admit(Standing("m", TEAM, FIRST), closed=False)
    assert not master.gather(deadline=0.0)
