"""The router: the process to which all participants connect. It checks certificates and the rights to write.

It is a separate process (`router_process.py`) that stores only frames in transit. zenoh's access control cannot be
changed while the router runs. To register or revoke a participant, the router is restarted with other rules, in a
fraction of a second; frames sent meanwhile are recovered (`transport.py`). Refusals are visible only in the router's
log, so the log is parsed (`Log`).
"""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import nullcontext
from typing import IO, NamedTuple, cast

from robochoc.authority.identity import Identity
from robochoc.communication.network.access import access_control, journal_qos
from robochoc.communication.network.transport import encoded
from robochoc.system.errors import RobochocError
from robochoc.system.signals import signals_delayed

START_S = 60.0
"""The longest wait until the router listens, in seconds. If all cores are busy, Python needs seconds to start."""
_PROCESS = "robochoc.communication.network.router_process"
_READY = "listening"
_RESPONDING = b"responding\n"
_CHECK_S = 0.5
"""The interval between two checks that the router's process responds, in seconds."""
_LOG = "warn"
_LOG_OF_REFUSALS = "warn,zenoh::net::routing::interceptor=trace,zenoh_link_tls=debug"
"""Excludes allowed actions from the log: they would cause several lines per frame, which cost more than the frame."""
_CHUNK = 65536
_DECISION = re.compile(
    rb"ThreadId\((\d+)\) zenoh::net::routing::interceptor(?:"
    rb"::access_control: [^\n]*?(?:CertCommonName\([^)\n]*\)\S*\+|Using cached result: )([0-9a-f]+) is unauthorized to "
    rb"([A-Za-z/ ]+?) \((in|e)gress\) on (\S+)|: (Msg intercepted!))"
)
"""The two lines of a refusal: one with the forbidden action of a session, one when it stops a message. Other threads
of the router may write lines between them.
"""
_TELLING = re.compile(rb"unauthorized|intercepted|zenoh_link_tls")
_KNOWN = re.compile(rb"CertCommonName\(([^)]*)\)\S*\+([0-9a-f]+) is unauthorized")
_ACCEPTED = re.compile(rb"zenoh_link_tls::unicast: Accepted TLS connection [^\n]*Common Name: ([^\n]*)\.\n")
_TLS = re.compile(rb"WARN [^\n]*zenoh_link_tls::unicast: ([^\n]*)")
_HINT = re.compile(r"\. Hint: .*$")
CLOSED_EARLY = "it has closed the connection during the handshake"
_MEANINGS = {
    "invalid peer certificate: UnknownIssuer": "its certificate was not issued by this Authority",
    "invalid peer certificate: certificate expired": "its certificate has expired",
    "invalid peer certificate: certificate not valid yet": "its certificate is not valid yet",
    "invalid peer certificate": "its certificate is invalid",
    "peer sent no certificates": "it has sent no certificate",
    "received corrupt message": "it does not speak TLS",
    "received fatal alert: UnknownCA": "it does not trust the master, which its Authority has not certified",
    "tls handshake eof": CLOSED_EARLY,
}
"""The meanings of zenoh's texts for refused connections. The first match counts."""
_KEPT_SESSIONS = 10_000
_KEPT_THREADS = 100
_COLOURS = re.compile(rb"\x1b\[[0-9;]*m")


class RouterError(RobochocError):
    """Raised if the router cannot listen."""


class Refusal(NamedTuple):
    """The router has refused `what` to `who` (the name in the certificate; `somebody`: a client not admitted)."""

    who: str
    what: str
    why: str


RefusalObserver = Callable[[Refusal], None]


class Router:
    """Runs the router's process with the master's `identity`, on `endpoint` (`HOST:PORT`).

    `refused` receives refusals, from another thread (None: no refusals are reported, which is much faster). The opener
    closes the router. The router's process removes `scratch` if this process dies (see `NetworkSettings`). A router
    that does not respond for `patience_s` seconds is killed, because zenoh would wait much longer for a stopped
    process.
    """

    def __init__(
        self,
        endpoint: str,
        identity: Identity,
        refused: RefusalObserver | None,
        lease_ms: int,
        scratch: str = "",
        patience_s: float = 10.0,
    ) -> None:
        self.endpoint = endpoint
        self._identity = identity
        self._refused = refused
        self._lease_ms = lease_ms
        self._scratch = scratch
        self._process: subprocess.Popen[bytes] | None = None
        self._reader: threading.Thread | None = None
        self._patience_s = patience_s
        self._response = threading.Event()
        self._is_closed = threading.Event()
        self._watcher: threading.Thread | None = None
        self._was_late = False
        self._is_silent = False

    def open(self, reach: Mapping[str, Sequence[str]], sniffers: Collection[str] | None = None) -> None:
        """Listen, with these rules (see `access_control`) instead of the previous rules. Raises `RouterError`.

        Ctrl-C and SIGTERM wait until a router with new rules listens: a master without a router could not announce its
        end.
        """
        with signals_delayed() if self._process else nullcontext():
            self.close()
            self._open(reach, sniffers)

    def _open(self, reach: Mapping[str, Sequence[str]], sniffers: Collection[str] | None) -> None:
        with signals_delayed():
            self._process = process = subprocess.Popen(  # noqa: S603 - our own module, with this interpreter
                [sys.executable, "-P", "-m", _PROCESS],  # -P: ignore modules in the working directory
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env={**os.environ, "RUST_LOG": _LOG_OF_REFUSALS if self._refused else _LOG, "NO_COLOR": "1"},
                start_new_session=True,
            )
        if process.stdin is None or process.stdout is None:
            raise RouterError("the router's process has no standard streams")
        process.stdin.write(f"{json.dumps(self._scratch)}\n{json.dumps(self._settings(reach, sniffers))}\n".encode())
        process.stdin.flush()
        first_output = self._wait_until_ready(process.stdout)
        self._reader = threading.Thread(
            target=self._read, args=[process.stdout, Log([*reach, self._identity.name]), first_output], daemon=True
        )
        self._reader.start()
        self._is_closed.clear()
        self._response.clear()
        self._watcher = threading.Thread(target=self._watch, args=[process, process.stdin], daemon=True)
        self._watcher.start()

    @property
    def failure(self) -> str:
        """The reason why the router has failed; empty if it works or was closed."""
        if self._process is None or self._process.poll() is None:
            return ""
        return f"did not respond for {self._patience_s:g} s" if self._is_silent else "has ended"

    def _watch(self, process: subprocess.Popen[bytes], questions: IO[bytes]) -> None:
        """Kill the router's process if it no longer responds.

        Time is counted in steps of `_CHECK_S`, so that the router gets time to respond even if this process was
        stopped.
        """
        silent_s = 0.0
        while silent_s < self._patience_s:
            if silent_s == 0:
                try:
                    os.write(questions.fileno(), b"\n")  # unbuffered: `close` would write buffered bytes
                except (OSError, ValueError):  # the process has ended
                    return
            if not self._response.wait(_CHECK_S):
                silent_s += _CHECK_S
            elif self._is_closed.wait(_CHECK_S):
                return
            else:
                self._response.clear()
                silent_s = 0.0
        self._is_silent = True
        process.kill()

    def close(self) -> None:
        """Close all links, and end the router's process at once."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        self._is_closed.set()
        self._response.set()
        for thread in (self._reader, self._watcher):
            if thread:
                thread.join()
        for stream in (process.stdin, process.stdout):
            if stream:
                stream.close()

    def _settings(self, reach: Mapping[str, Sequence[str]], sniffers: Collection[str] | None) -> dict[str, object]:
        texts = self._identity.texts
        return {
            "mode": "router",
            "listen/endpoints": [f"tls/{self.endpoint}"],
            "connect/endpoints": [],
            "transport/link/tls": {
                "root_ca_certificate_base64": encoded(texts.ca),
                "listen_private_key_base64": encoded(texts.key),
                "listen_certificate_base64": encoded(texts.certificate),
                "enable_mtls": True,
                "close_link_on_expiration": True,
            },
            "transport/link/tx/lease": self._lease_ms,
            "access_control": access_control(reach, sniffers, self._identity.name),
            "qos/network": [] if sniffers is None else [journal_qos()],
        }

    def _wait_until_ready(self, output: IO[bytes]) -> bytes:
        """Wait until the router is ready, and return its output so far. Waiting peers connect even before that."""
        first_output: list[bytes] = []
        watch = threading.Timer(START_S, self._give_up)
        watch.start()
        try:
            for line in output:
                if line.strip() == _READY.encode():
                    return b"".join(first_output)
                first_output.append(line)
        finally:
            watch.cancel()
        silence = f"it was not ready after {START_S:g} s" if self._was_late else "it ended without a message"
        why = b"; ".join(line.strip() for line in first_output[-2:]).decode(errors="replace") or silence
        raise RouterError(f"cannot listen on {self.endpoint}: {why}")

    def _give_up(self) -> None:
        self._was_late = True
        if self._process:
            self._process.kill()

    def _read(self, output: IO[bytes], log: Log, first_output: bytes) -> None:
        """Read the log in chunks until its end (up to 80,000 lines per second), and report refusals."""
        rest = b""
        for refusal in log.refusals(first_output):
            if self._refused:
                self._refused(refusal)
        while chunk := cast("io.BufferedReader", output).read1(_CHUNK):
            text = rest + chunk
            whole = text.rfind(b"\n") + 1
            if text.find(_RESPONDING, 0, whole) >= 0:
                self._response.set()
            if self._refused and _TELLING.search(text, 0, whole):
                for refusal in log.refusals(text[:whole]):
                    self._refused(refusal)
            rest = text[whole:]


class Log:
    """Parses refusals in the router's log. Only the `admitted` names have rules."""

    def __init__(self, admitted: Collection[str]) -> None:
        self._admitted = admitted
        self._names: dict[bytes, str] = {}
        """The name of each session. zenoh logs the certificate's name only when the right is not in its cache."""
        self._denied: dict[bytes, tuple[bytes, bytes, bytes] | None] = {}
        """Each thread's latest forbidden action, with its session and key (None: an outgoing message)."""

    def refusals(self, log: bytes) -> Iterator[Refusal]:
        """Yield the refusals in a part of the log. The part must consist of complete lines."""
        plain = _COLOURS.sub(b"", log)
        for name in _ACCEPTED.findall(plain):
            who = name.decode(errors="replace")
            if who not in self._admitted:
                yield Refusal(who, "connect", "it is not registered with the Authority")
        if len(self._names) > _KEPT_SESSIONS:
            self._names.clear()
        self._names.update((session, name.decode(errors="replace")) for name, session in _KNOWN.findall(plain))
        yield from self._stopped(plain)
        for why in _TLS.findall(plain):
            yield Refusal("somebody", "connect", _meaning(_HINT.sub("", why.decode(errors="replace"))))

    def _stopped(self, log: bytes) -> Iterator[Refusal]:
        """Yield the stopped incoming messages, each with the latest forbidden action in the same thread."""
        if len(self._denied) > _KEPT_THREADS:
            self._denied.clear()
        for thread, session, what, direction, where, intercepted in _DECISION.findall(log):
            if not intercepted:
                self._denied[thread] = (session, what, where) if direction == b"in" else None
            elif (denied := self._denied.pop(thread, None)) and denied[0] in self._names:
                action = f"{denied[1].decode().lower()} {denied[2].decode(errors='replace')}"
                yield Refusal(self._names[denied[0]], action, "no rule of the Authority allows it")


def _meaning(why: str) -> str:
    return next((meaning for words, meaning in _MEANINGS.items() if why.startswith(words)), why)
