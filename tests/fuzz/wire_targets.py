"""What comes over the wire: frames and what is in them, requests to the Directory, ACL, questions of newcomers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from random import Random

import msgspec

from robochoc.authority.certificates import (
    CertificateError,
    ca_certificate,
    check_issued,
    holder_of,
    hosts_of,
    leaf_certificate,
    new_key,
    pem,
    read_certificate,
    read_request,
    signing_request,
    utc_time,
)
from robochoc.authority.frames import (
    Certified,
    EnrolmentDenied,
    FrameError,
    Introduce,
    Introduction,
    Redeem,
    Renew,
    decode_answer,
    decode_question,
)
from robochoc.authority.keyring import KeyCard, KeyCardError
from robochoc.communication.control import Conclusion, Counters, CounterWave, Events, Pause, Ready, RobotFailed
from robochoc.communication.network import control_messages as words
from robochoc.communication.network.constraint_records import SharedConstraintError, SharedRecord, known_of, record_of
from robochoc.communication.network.framing import MASTER, FrameRefusedError, Framing
from robochoc.communication.network.profile import (
    Profile,
    ProfileError,
    domain_of,
    in_priority_order,
    missing,
    possible_neighbours,
    profile_contradictions,
    profile_of,
    visible_robot,
)
from robochoc.formats import on_one_line
from robochoc.journal.events import AnyEvent, Decided, Sent
from robochoc.model.outcome import Metrics, PseudoTreeNode, Verdict
from robochoc.model.problem import Robot, Team
from robochoc.protocols.acts import Performative
from robochoc.protocols.findings import Findings
from robochoc.services.descriptions import AgentDescription, ServiceDescription
from robochoc.services.directory import Directory
from robochoc.services.facilitator import handle, subscribe
from robochoc.services.identifier import AgentIdentifier, identifier_on
from robochoc.services.sl import DirectoryFunction, df_on, request
from robochoc.sniffer.acl import ACLError, ACLMessage, parse, text
from robochoc.solver.explanation import KeyedConstraint
from tests.fuzz.harness import Target, assert_said
from tests.fuzz.mutations import one_of, spoilt_bytes, spoilt_msgpack, spoilt_text
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_cost_team
from tests.support.problems import random_team

LATEST = 1_800_000_000.0
PLATFORM = "host:7447/robochoc"


@cache
def _teams() -> Sequence[Team]:
    chance = Random(2)
    return [maker(chance) for maker in (random_team, random_cost_team, random_complex_team)]


@cache
def _robots() -> Sequence[Robot]:
    return [robot for team in _teams() for robot in team.robots]


def _packed(value: object) -> bytes:
    return msgspec.msgpack.encode(value)


# Frames


@cache
def frames(receiver: str) -> Sequence[bytes]:
    """Frames to the master, or to a robot, with every word."""
    metrics = Metrics({"Ok": 3}, 80, 5, 9, 0.25)
    epoch = 1
    findings = Findings(bound=3, place=PseudoTreeNode("R", ("S",)))
    events: list[AnyEvent] = [
        Sent(t=0, sender="A", receiver="B", type="Ok", content={"value": [1]}, bytes=9, clock=3),
        Decided(t=0.5, robot="A", assignment={"V": 1}, clock=4),
    ]
    said: list[words.ControlMessage] = [
        *(words.Register(profile_of(one), "incarnation") for one in _robots()),
        words.Joined("incarnation", b""),
        words.DomainAnswer({"V": ((1, 3), (5, 7))}, ("V",), {"V": 3}),
        Ready(epoch),
        Counters(epoch, 1, 7, 7),
        Conclusion(epoch, Verdict.NO_SOLUTION),
        Events(events),
        words.DetailedReport(epoch, assigned=True, assignment={"V": 1}, metrics=metrics, findings=findings),
        words.CheckResult(epoch, allowed=True, cost=3),
        RobotFailed("it broke"),
        words.Objection("A", "a frame", "it is a replay"),
        words.DirectoryRequest(1, _requests()[0].decode()),
        words.JournalRequest(2),
        words.Bye(),
    ]
    if receiver != MASTER:
        said = [
            words.Welcome("incarnation", "run", ("sealed",), observed=True, private=False),
            words.RegistrationDenied("incarnation", "revoked"),
            words.DomainRequest(("V", "W")),
            words.SearchTask(
                epoch,
                protocol="abt",
                order=("A", "B"),
                interfaces={"A": ("V",), "B": ("W",)},
                domains={"V": ((1, 3),), "W": ((1, 3),)},
                links={"B": ("A",)},
                secretive=(),
                seed=7,
                settings={"window": "1"},
                aside=None,
                cards=(b"card",),
            ),
            words.StartSearch(epoch),
            CounterWave(3),
            Pause(),
            words.CheckRequest(epoch, {"V": 1}),
            words.Revoked("B"),
            words.DirectoryAnswer(1, "inform", "((done x))"),
            words.JournalAnswer(2, "run", ""),
            words.Leave("solved", failed=False),
        ]
        said += [words.ProtocolMessage(epoch, 5, b"\x92\xa2Ok\x91\x01"), words.Copies(epoch, records()[0])]
    return [_packed(["run", place + 1, word]) for place, word in enumerate(said)]


def check_frame(receiver: str, content: bytes) -> bool:
    """A frame is read or refused; a word that is accepted can be looked at, and written again."""
    senders = [MASTER] if receiver == MASTER else [MASTER, "B"]
    accepted = False
    for sender in senders[::-1] if receiver != MASTER else ["B"]:
        for _ in range(2):
            reader = Framing(receiver, "run")
            try:
                number = msgspec.msgpack.decode(content)[1]
                if isinstance(number, int) and 1 < number < 1 << 62:
                    reader.accept(sender, number - 1)
            except Exception:  # noqa: BLE001, S110 - then it expects the first one
                pass
            try:
                opened = reader.read(sender, content)
            except FrameRefusedError as refused:
                on_one_line(str(refused)).encode()
                continue
            accepted = True
            _look_into(opened.message)
            writer = Framing(sender, "run")
            again = Framing(receiver, "run").read(sender, writer.write(receiver, opened.message))
            assert repr(again.message) == repr(opened.message), "another word is read from what was written"
    return accepted


def _look_into(word: words.ControlMessage) -> None:
    match word:
        case words.Register(profile):
            _introduce(profile)
        case words.DomainAnswer(variables):
            for name, ranges in variables.items():
                _refused_or(ProfileError, partial(domain_of, name, ranges))
        case words.Joined(_, card):
            _refused_or(KeyCardError, partial(KeyCard.decode, card))
        case words.DirectoryRequest(_, text):
            check_request(text.encode())
        case words.Copies(_, content):
            check_records(content)
        case _:
            pass


def _refused_or(refusal: type[ValueError], act: Callable[[], object]) -> bool:
    """Whether `act` went well; a `refusal` says why not."""
    try:
        act()
    except refusal as refused:
        assert_said(refused)
        return False
    return True


def _introduce(profile: Profile) -> bool:
    try:
        robot = visible_robot(profile, {})
    except ProfileError as bad:
        assert_said(bad)
        return False
    others = {one.name: profile_of(one) for one in _teams()[0].robots}
    profiles = {**others, profile.name: profile}
    wrong = list(profile_contradictions(profiles))
    missing(profiles)
    possible_neighbours(profiles)
    if not wrong:
        in_priority_order(profiles)
    for one in robot.variables:
        told = [value for low, high in profile.variables[one.name] for value in range(low, high + 1)]
        assert [*one.domain] == told, "a domain has other values than were told"
    return True


# Shared constraints


@cache
def records() -> Sequence[bytes]:
    """Constraints as they travel."""
    found = [
        record_of(KeyedConstraint(f"{robot.name}<{one.name}", one))
        for robot in _robots()
        for one in (*robot.private, *robot.shared)
    ]
    return [_packed(found[start : start + 3]) for start in range(0, len(found), 3)]


def check_records(content: bytes) -> bool:
    """Constraints are read or refused; what is read can be asked, and travels on."""
    try:
        found = msgspec.msgpack.decode(content, type=tuple[SharedRecord, ...])
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        return False
    accepted = False
    for record in found:
        try:
            known = known_of(record)
        except SharedConstraintError as bad:
            assert_said(bad)
            continue
        accepted = True
        one = known.constraint
        for value in (0, 1, -7, 10**6):
            assert one.price(dict.fromkeys(one.variables, value)) >= 0
        again = known_of(msgspec.msgpack.decode(_packed(record_of(known)), type=SharedRecord))
        assert repr(again) == repr(known), "another constraint is read from what was written"
    return accepted


# The Directory, and ACL


@cache
def _requests() -> Sequence[bytes]:
    df = df_on(PLATFORM)
    service = ServiceDescription("s", "robot", "me", ("abt",), ("o",), ("sl",), (("k", "v"),))
    whole = AgentDescription(
        f"R@{PLATFORM}", (service,), ("abt",), ("o",), ("sl",), lease_s=60.0, addresses=("tcp/1.2.3.4:5",)
    )
    asked = [
        *((function, whole, None) for function in DirectoryFunction),
        (DirectoryFunction.SEARCH, AgentDescription(services=(ServiceDescription(type="robot"),)), 3),
    ]
    return [request(df, function, description, most).encode() for function, description, most in asked]


def check_request(content: bytes) -> bool:
    """The Directory answers whatever it is asked, and what it answers can be read."""
    text_asked = content.decode("utf-8", "replace")
    fresh, used = Directory(), Directory()
    handle(used, f"R@{PLATFORM}", _requests()[0].decode(), 0)
    accepted = False
    for directory in (fresh, used):
        for ask in (handle, subscribe, handle):
            performative, answer = ask(directory, f"R@{PLATFORM}", text_asked, 1.0)
            assert len(answer) < 1 << 20, "the answer is long"
            accepted = accepted or performative in {Performative.INFORM, Performative.AGREE}
    return accepted


@cache
def acts() -> Sequence[bytes]:
    """Messages of FIPA ACL."""
    one, other = identifier_on(PLATFORM, "A", ("tcp/1.2.3.4:5",)), AgentIdentifier("B@p", (), ())
    return [
        text(ACLMessage(Performative.INFORM, one, (other,), content='say "hi" \\ é')).encode(),
        text(
            ACLMessage(
                Performative.REQUEST,
                *(one, (other, one), (one,), "(x)", "fipa-sl0", "utf-8", "o", "p", "c", "r", "i"),
                reply_by="20260131T120000000Z",
                user=(("x-clock", "7"), ("x-a", "b c")),
            )
        ).encode(),
    ]


def check_act(content: bytes) -> bool:
    """A message of FIPA ACL is read or refused; what is read is written, and read as the same."""
    try:
        message = parse(content.decode("utf-8", "replace"))
    except ACLError as bad:
        assert_said(bad)
        return False
    assert parse(text(message)) == message, "another message is read from what was written"
    return True


# Enrolment


@cache
def _authority() -> tuple[bytes, bytes, bytes]:
    key, own, now = new_key(), new_key(), utc_time(LATEST)
    ca = ca_certificate(key, now)
    leaf = leaf_certificate(
        (ca, key), own.public_key(), "R1", ["localhost", "10.0.0.1"], (now, utc_time(LATEST + 3600))
    )
    return pem(ca), pem(leaf), signing_request(own, "R1")


@cache
def questions() -> Sequence[bytes]:
    """Questions of robots that want to be certified, and answers to them."""
    ca, leaf, asked = _authority()
    frames = (
        Introduce(),
        Redeem(b"s" * 32, asked),
        Renew(asked),
        Introduction(ca),
        Certified(leaf),
        EnrolmentDenied("no"),
    )
    return [_packed(frame) for frame in frames]


def check_question(content: bytes) -> bool:
    """A question or answer is read or refused, and so is what is in it."""
    accepted = False
    for decode in (decode_question, decode_answer):
        try:
            frame = decode(content)
        except FrameError as bad:
            assert_said(bad)
            continue
        accepted = True
        assert decode(_packed(frame)) == frame
        match frame:
            case Redeem(_, asked) | Renew(asked):
                _refused_or(CertificateError, partial(read_request, asked))
            case Introduction(certificate) | Certified(certificate):
                _refused_or(CertificateError, partial(_look_at, certificate))
            case _:
                pass
    return accepted


def _look_at(content: bytes) -> None:
    certificate = read_certificate(content)
    check_issued(certificate, read_certificate(_authority()[0]), utc_time(LATEST))
    hosts_of(certificate)
    holder_of(certificate)


_of_msgpack = one_of(spoilt_msgpack, spoilt_msgpack, spoilt_msgpack, spoilt_bytes)
_of_text = one_of(spoilt_text, spoilt_text, spoilt_bytes)
TARGETS = (
    Target("frame-to-master", partial(frames, MASTER), _of_msgpack, partial(check_frame, MASTER)),
    Target("frame-to-robot", partial(frames, "A"), _of_msgpack, partial(check_frame, "A")),
    Target("shared-constraints", records, _of_msgpack, check_records),
    Target("directory", _requests, _of_text, check_request),
    Target("acl", acts, _of_text, check_act),
    Target("enrolment", questions, _of_msgpack, check_question),
)
