"""Frames: numbers, replays, sizes, directions, and bytes of any kind."""

from __future__ import annotations

from functools import cache
from typing import get_args

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.control import Counters, CounterWave, Events, Ready, RobotFailed
from robochoc.communication.network.control_messages import (
    LATEST,
    CheckRequest,
    ControlMessage,
    Copies,
    DetailedReport,
    DirectoryAnswer,
    DirectoryRequest,
    DomainAnswer,
    Exchanged,
    Joined,
    JournalAnswer,
    JournalRequest,
    Leave,
    LostFrames,
    ProtocolMessage,
    Register,
    RegistrationDenied,
    SearchTask,
    StandbyAnswer,
    StandbyRequest,
    ToMaster,
    ToPeer,
    ToRobot,
    Welcome,
)
from robochoc.communication.network.framing import (
    LARGEST_FRAME,
    MASTER,
    Frame,
    FrameRefusedError,
    Framing,
    MessageTooLargeError,
    Opened,
)
from robochoc.communication.network.profile import Profile
from robochoc.journal.events import Received
from robochoc.model.outcome import Metrics, PseudoTreeNode
from robochoc.model.problem import ProblemKind
from robochoc.protocols.findings import Findings, Incumbent, Trail
from robochoc.protocols.inference.dpop import UTIL
from robochoc.protocols.inference.dpop_tables import PIECE
from robochoc.protocols.message import encode
from tests.support.cases import looped
from tests.support.examples import examples

PROFILE = Profile("R1", ProblemKind.DISCSP, ("R0",), (), {"X": ((1, 3), (5, 5))}, {}, 1, 0, ("/R1/goal",))
OUTSIDE = (
    Register,
    Welcome,
    RegistrationDenied,
    Joined,
    DirectoryRequest,
    DirectoryAnswer,
    JournalRequest,
    JournalAnswer,
    StandbyRequest,
    StandbyAnswer,
)
WORDS = get_args(ToMaster), get_args(ToRobot), get_args(ToPeer)


def pair(sender: str = "R1", receiver: str = "R2", run: str = "run") -> tuple[Framing, Framing]:
    return Framing(sender, run), Framing(receiver, run)


def said(number: int) -> ProtocolMessage:
    return ProtocolMessage(1, number, b"%d" % number)


TEXTS = st.text(max_size=5)
NUMBERS = st.integers(-(2**63), 2**64 - 1)
SEVERAL = st.lists(TEXTS, max_size=3).map(tuple)
DOMAINS = st.dictionaries(TEXTS, st.lists(st.tuples(NUMBERS, NUMBERS), max_size=2).map(tuple), max_size=2)
SPECIAL: dict[type[ControlMessage], st.SearchStrategy[ControlMessage]] = {
    DetailedReport: st.builds(
        DetailedReport,
        NUMBERS,
        st.dictionaries(TEXTS, NUMBERS, max_size=2),
        st.builds(Metrics, st.dictionaries(TEXTS, NUMBERS, max_size=2), NUMBERS, NUMBERS, NUMBERS),
        st.just(
            Findings(
                best=Incumbent(3, {"R1": (1, None)}), place=PseudoTreeNode("R0", ("R2",)), trail=Trail([(0, 1)], 4)
            )
        ),
        st.booleans(),
        st.dictionaries(TEXTS, st.builds(Exchanged, NUMBERS, NUMBERS, NUMBERS), max_size=2),
    ),
    LostFrames: st.builds(LostFrames, TEXTS, st.integers(1, 2**53)),
    DomainAnswer: st.builds(DomainAnswer, DOMAINS, SEVERAL, st.dictionaries(TEXTS, NUMBERS, max_size=2)),
    Register: st.builds(Register, st.just(PROFILE), TEXTS),
    Events: st.just(Events([Received(t=1.5, sender="R1", receiver="R2", type="Ok", clock=3)])),
    CheckRequest: st.builds(CheckRequest, NUMBERS, st.dictionaries(TEXTS, NUMBERS)),
    ProtocolMessage: st.builds(ProtocolMessage, NUMBERS, st.integers(0, LATEST), st.binary(max_size=5)),
    SearchTask: st.builds(
        SearchTask,
        epoch=NUMBERS,
        protocol=TEXTS,
        order=SEVERAL,
        interfaces=st.dictionaries(TEXTS, SEVERAL, max_size=2),
        domains=DOMAINS,
        links=st.none() | st.dictionaries(TEXTS, SEVERAL, max_size=2),
        secretive=SEVERAL,
        seed=NUMBERS,
        settings=st.dictionaries(TEXTS, TEXTS, max_size=2),
        aside=st.none() | st.floats(allow_nan=False),
        cards=st.lists(st.binary(max_size=5), max_size=2).map(tuple),
    ),
}


@cache
def some(kind: type[ControlMessage]) -> st.SearchStrategy[ControlMessage]:
    """Words of one kind: what their types allow, as far as it can travel."""
    return SPECIAL[kind] if kind in SPECIAL else st.from_type(kind).filter(_travels)


def _travels(word: ControlMessage) -> bool:
    """Not NaN, which is not equal to itself, nor integers of more than 64 bits."""
    try:
        return msgspec.msgpack.decode(msgspec.msgpack.encode(word), type=type(word)) == word
    except (OverflowError, UnicodeEncodeError, msgspec.ValidationError):
        return False


@looped("kind", [kind for direction in WORDS for kind in direction])
def test_every_word_comes_as_it_was_sent(kind: type[ControlMessage]) -> None:
    sender, receiver = ("R1", MASTER) if kind in WORDS[0] else (MASTER, "R1") if kind in WORDS[1] else ("R1", "R2")

    @given(word=some(kind))
    @examples(8)
    def arrives(word: ControlMessage) -> None:
        writer, reader = pair(sender, receiver)
        opened = reader.read(sender, writer.write(receiver, word))
        assert opened.message == word
        assert type(opened.message) is kind
        assert opened.number == (0 if kind in OUTSIDE else 1)

    arrives()


# Numbers


def test_frames_are_numbered_by_pair_and_come_once() -> None:
    writer, reader = pair()
    contents = [writer.write("R2", said(n)) for n in (1, 2, 3)]
    assert writer.next_number("R2") == 4
    assert writer.next_number("R3") == 1
    for number, content in enumerate(contents, 1):
        opened = reader.read("R1", content)
        assert opened == Opened(number, said(number))
        reader.accept("R1", opened.number)
        with pytest.raises(FrameRefusedError, match=f"replay: frame {number} has already arrived"):
            reader.read("R1", content)


def test_what_was_not_taken_may_come_again() -> None:
    writer, reader = pair()
    content = writer.write("R2", said(1))
    assert [reader.read("R1", content) for _ in range(2)] == [(1, said(1))] * 2
    reader.accept("R1", 1)
    with pytest.raises(FrameRefusedError, match="replay"):
        reader.read("R1", content)


def test_a_missing_frame_is_missed() -> None:
    writer, reader = pair()
    first, second = (writer.write("R2", said(n)) for n in (1, 2))
    with pytest.raises(FrameRefusedError, match="frame 1 is missing before frame 2"):
        reader.read("R1", second)
    reader.accept("R1", reader.read("R1", first).number)
    assert reader.read("R1", second).message == said(2)


def test_senders_do_not_use_up_each_others_numbers() -> None:
    reader = Framing("R9", "run")
    for sender in ("R1", "R2"):
        opened = reader.read(sender, Framing(sender, "run").write("R9", said(1)))
        reader.accept(sender, opened.number)
    with pytest.raises(FrameRefusedError, match="frame 2 is missing before frame 3"):
        reader.read("R2", msgspec.msgpack.encode(Frame("run", 3, said(3))))


@looped("number", [0, -1, -(2**63)])
def test_numbers_begin_at_1(number: int) -> None:
    with pytest.raises(FrameRefusedError, match="replay"):
        pair()[1].read("R1", msgspec.msgpack.encode(Frame("run", number, said(1))))


def test_frames_of_another_run_are_replays() -> None:
    old, reader = Framing("R1", "before"), Framing("R2", "run")
    content = old.write("R2", said(1))
    with pytest.raises(FrameRefusedError, match="another run"):
        reader.read("R1", content)
    with pytest.raises(FrameRefusedError, match="another run"):
        Framing("R2").read("R1", content)
    with pytest.raises(FrameRefusedError, match="another run"):
        Framing("R2").read("R1", Framing("R1").write("R2", said(1)))  # no run is no run in common


def test_a_new_run_begins_at_1() -> None:
    writer, reader = pair()
    reader.accept("R1", reader.read("R1", writer.write("R2", said(1))).number)
    for one in (writer, reader):
        one.start_run("next")
    assert reader.read("R1", writer.write("R2", said(2))) == (1, said(2))


def test_another_life_begins_at_1_for_that_robot_only() -> None:
    master = Framing(MASTER, "run")
    for name in ("R1", "R2"):
        master.accept(name, master.read(name, Framing(name, "run").write(MASTER, Ready(1))).number)
        master.write(name, CounterWave(1))
    master.forget("R1")
    master.forget("R7")
    assert (master.next_number("R1"), master.next_number("R2")) == (1, 2)
    assert master.read("R1", Framing("R1", "run").write(MASTER, Ready(1))).number == 1
    with pytest.raises(FrameRefusedError, match="replay"):
        master.read("R2", Framing("R2", "run").write(MASTER, Ready(1)))


def test_words_before_a_run_have_no_number() -> None:
    robot, master = Framing("R1"), Framing(MASTER, "run")
    content = robot.write(MASTER, Register(PROFILE, "incarnation"))
    for _ in range(2):
        opened = master.read("R1", content)
        assert opened == Opened(0, Register(PROFILE, "incarnation"))
        master.accept("R1", opened.number)
    assert robot.next_number(MASTER) == 1
    answer = master.write("R1", Welcome("incarnation", "run", (), observed=False, private=False))
    assert robot.read(MASTER, answer).number == 0
    assert master.read("R1", Framing("R1", "run").write(MASTER, Ready(1))).number == 1


# Sizes


def test_a_frame_that_is_too_large_is_not_written_and_uses_no_number() -> None:
    writer, reader = pair()
    with pytest.raises(MessageTooLargeError, match=r"R1 to R2 has 8,\d\d\d,\d\d\d bytes, more than 8,388,608"):
        writer.write("R2", ProtocolMessage(1, 0, bytes(LARGEST_FRAME)))
    assert reader.read("R1", writer.write("R2", said(1))).number == 1


def test_a_piece_of_a_table_fits_into_a_frame() -> None:
    content = encode(UTIL(1, bytes(PIECE)))
    assert len(pair()[0].write("R2", ProtocolMessage(1, 0, content))) <= LARGEST_FRAME


def test_a_frame_that_is_too_large_is_not_read() -> None:
    content = msgspec.msgpack.encode(Frame("run", 1, ProtocolMessage(1, 0, bytes(LARGEST_FRAME))))
    with pytest.raises(FrameRefusedError, match="more than 8,388,608"):
        pair()[1].read("R1", content)


def test_the_largest_frame_passes() -> None:
    writer, reader = pair()
    spare = len(msgspec.msgpack.encode(Frame("run", 1, ProtocolMessage(1, 0, bytes(70_000))))) - 70_000
    content = writer.write("R2", ProtocolMessage(1, 0, bytes(LARGEST_FRAME - spare)))
    assert len(content) == LARGEST_FRAME
    assert reader.read("R1", content).number == 1


# Directions


@pytest.mark.parametrize(
    ("sender", "receiver", "direction"),
    [("R1", MASTER, 0), (MASTER, "R1", 1), ("R1", "R2", 2)],
    ids=["to the master", "to a robot", "to a peer"],
)
@given(data=st.data())
@examples(3)
def test_words_of_another_direction_are_refused(
    sender: str, receiver: str, direction: int, data: st.DataObject
) -> None:
    for place, kinds in enumerate(WORDS):
        for kind in kinds:
            word = data.draw(some(kind))
            content = msgspec.msgpack.encode(Frame("run", 1, word))
            reader = Framing(receiver, "run")
            if place == direction:
                assert type(reader.read(sender, content).message) is kind
            else:
                with pytest.raises(FrameRefusedError, match="malformed"):
                    reader.read(sender, content)


# Bytes


@pytest.mark.parametrize(("sender", "receiver"), [("R1", MASTER), (MASTER, "R1"), ("R1", "R2")])
@given(content=st.binary(max_size=200))
@examples(100)
def test_arbitrary_bytes_are_refused(sender: str, receiver: str, content: bytes) -> None:
    with pytest.raises(FrameRefusedError, match="malformed"):
        Framing(receiver, "run").read(sender, content)


FRAMES = [
    (sender, receiver, msgspec.msgpack.encode(Frame("run", 1, word)))
    for sender, receiver, word in (
        ("R1", MASTER, Register(PROFILE, "incarnation")),
        ("R1", MASTER, RobotFailed("why", unsupported=True)),
        ("R1", MASTER, Counters(1, 2, 3, 4)),
        (MASTER, "R1", Leave("over", failed=False)),
        ("R1", "R2", ProtocolMessage(1, 3, b"content")),
        ("R1", "R2", Copies(1, b"")),
    )
]


@given(frame=st.sampled_from(FRAMES), data=st.data())
@examples(300)
def test_damaged_frames_are_refused_or_read_never_worse(frame: tuple[str, str, bytes], data: st.DataObject) -> None:
    sender, receiver, content = frame
    bit = data.draw(st.integers(0, 8 * len(content) - 1))
    flipped = bytearray(content)
    flipped[bit // 8] ^= 1 << bit % 8
    for damaged in (bytes(flipped), content[: bit // 8], content + bytes(flipped[: 1 + bit // 8])):
        reader = Framing(receiver, "run")
        try:
            opened = reader.read(sender, damaged)
        except FrameRefusedError:
            continue
        assert opened.number in {0, 1}  # a bit of the content can be another


@looped("nested", [b"\x91" * 5000, b"\x81" * 5000, b"\x93\xa3run\x01" + b"\x92" * 100_000])
def test_deep_nesting_is_refused(nested: bytes) -> None:
    for sender in (MASTER, "R1"):
        with pytest.raises(FrameRefusedError, match="malformed"):
            Framing("R2", "run").read(sender, nested)


def test_a_length_that_lies_allocates_nothing() -> None:
    for lie in (b"\xdd\xff\xff\xff\xff", b"\xc6\xff\xff\xff\xff", b"\xdb\xff\xff\xff\xff"):
        with pytest.raises(FrameRefusedError, match="malformed"):
            pair()[1].read("R1", b"\x93\xa3run\x01\x94\xa4Said\x01\x01" + lie)
