"""The messages between robots and the enrolment service: one question and one answer, each a length and msgpack.

The length has 4 bytes, most significant first. Input is read up to a deadline and a maximum size, and decoded to one of
these structs, or rejected.
"""

from __future__ import annotations

import socket
import time

import msgspec

from robochoc.system.errors import RobochocError

LARGEST_BYTES = 16384
"""The maximum size of a frame. A request for a certificate has about 350 bytes, a certificate 800."""
_LENGTH_BYTES = 4


class FrameError(RobochocError, ValueError):
    """The frame is not a valid question or answer of this protocol."""


class _Frame(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """The base class of all frames."""


class Introduce(_Frame, frozen=True):
    """Requests the certificate of the server's Authority."""


class Redeem(_Frame, frozen=True):
    """Requests a certificate for `request` (PKCS 10, PEM) in exchange for the secret of a token."""

    secret: bytes
    request: bytes


class Renew(_Frame, frozen=True):
    """Requests a new certificate for `request` (PKCS 10, PEM), authorized by the certificate of this connection."""

    request: bytes


class Introduction(_Frame, frozen=True):
    """The Authority's certificate (PEM)."""

    ca: bytes


class Certified(_Frame, frozen=True):
    """The requested certificate (PEM)."""

    certificate: bytes


class EnrolmentDenied(_Frame, frozen=True, tag="Denied"):
    """A refusal with its reason."""

    why: str


Question = Introduce | Redeem | Renew
Answer = Introduction | Certified | EnrolmentDenied
_questions = msgspec.msgpack.Decoder(Question)
_answers = msgspec.msgpack.Decoder(Answer)


def decode_question(content: bytes) -> Question:
    """Return the question in `content`. Raises `FrameError`."""
    try:
        question: Question = _questions.decode(content)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise FrameError(f"invalid request: {error}") from error
    return question


def decode_answer(content: bytes) -> Answer:
    """Return the answer in `content`. Raises `FrameError`."""
    try:
        answer: Answer = _answers.decode(content)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise FrameError(f"invalid response: {error}") from error
    return answer


class Exchange:
    """Exchanges frames on a connected socket, all within `seconds` from now, even if their bytes arrive slowly."""

    def __init__(self, connection: socket.socket, seconds: float) -> None:
        self._connection = connection
        self._deadline = time.monotonic() + seconds

    def wait(self) -> None:
        """Limit the socket's next operation to the remaining time. Raises `TimeoutError` if none remains."""
        left = self._deadline - time.monotonic()
        if left <= 0:
            raise TimeoutError("the time limit is exceeded")
        self._connection.settimeout(left)

    def send(self, frame: Question | Answer) -> None:
        """Send `frame`. Raises `OSError`."""
        content = msgspec.msgpack.encode(frame)
        self.wait()
        self._connection.sendall(len(content).to_bytes(_LENGTH_BYTES, "big") + content)

    def question(self) -> Question:
        """Return the next frame, which must be a question. Raises `OSError`, `FrameError`."""
        return decode_question(self._receive())

    def answer(self) -> Answer:
        """Return the next frame, which must be an answer. Raises `OSError`, `FrameError`."""
        return decode_answer(self._receive())

    def _receive(self) -> bytes:
        length = int.from_bytes(self._exactly(_LENGTH_BYTES), "big")
        if length > LARGEST_BYTES:
            raise FrameError(f"the frame has {length} bytes, more than the maximum of {LARGEST_BYTES}")
        return self._exactly(length)

    def _exactly(self, size: int) -> bytes:
        content = bytearray()
        while len(content) < size:
            self.wait()
            part = self._connection.recv(size - len(content))
            if not part:
                raise FrameError("the connection was closed in the middle of a frame")
            content += part
        return bytes(content)
