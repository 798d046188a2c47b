"""A stranger who has the application's address: it opens a page as a browser does, and sends whatever it likes."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Callable, Iterator
from random import Random
from typing import Any
from urllib.parse import urlencode

import pytest

from tests.support.limits import HANG_S

NAMES = (
    "<script>document.title='broken'</script>",
    '"><img src=x onerror="document.title=\'broken\'">',
    'x" :onx="document.title=\'broken\'" innerHTML="<b>',
    "{{7*7}}",
    "${7*7}`",
    "\u202eevil",
    "\x1b[2J\x00\x07",
    "a\nb\rc",
    "__proto__",
    "../../../../etc/passwd",
    "\U0001f916\u200d\U0001f525",
    "\u05e9\u05dc\u05d5\u05dd",
    "",
    " ",
    "%s%n{0}{key.__class__}",
)
"""Texts that are nobody's name, and that some program somewhere has taken for something else."""
_LONG = 900_000
"""Characters of a text that is far too long. Of a longer message, the server closes the connection."""
_NUMBERS = (0, -1, 1, 2, 0.5, -0.0, 60, 61, 10**6, 10**18, 2**63, -(2**63), 1e300, -1e300)
_TYPED = ("1-5", "1, 2, 5", "0-999999999", "nan", "inf", "-inf", "1e400", "\u0664", "9" * 400, "a,b,c", "x" * 20_000)
_RAW = ("NaN", "Infinity", "-Infinity", "1e400", "1" + "0" * 400, "[" * 5_000, "{", "", "\0", '"\\ud800"')
"""What is no JSON, or what not every reader of JSON takes."""
_WORDS = ("R1", "slot", "model", "must", "cost", "team", "add", "block", "auto")
_ELEMENTS = re.compile(r"parseElements\(String\.raw`(.*?)`\)", re.DOTALL)
_CLIENT = re.compile(r"'client_id': '([^']+)'")
_DEEPEST = 3


class HostileClient:
    """A client of one page.

    Args:
        url: The page.
        base: The application's address.
        session: Of aiohttp.
    """

    def __init__(self, url: str, base: str, session: Any) -> None:  # noqa: ANN401 - aiohttp's
        socketio = pytest.importorskip("socketio")
        self._elements: dict[str, dict[str, Any]] = {}
        self._stale: list[tuple[str, str]] = []
        self._url, self._base, self._session = url, base, session
        self._socket = socketio.AsyncClient(reconnection=False, http_session=session)
        self._socket.on("update", self._updated)
        self._id = ""

    async def open(self) -> None:
        """Get the page, and connect its socket."""
        async with self._session.get(self._url) as answer:
            assert answer.status == 200, (self._url, answer.status)
            page = await answer.text()
        found, client = _ELEMENTS.search(page), _CLIENT.search(page)
        assert found, self._url
        assert client, self._url
        self._elements, self._id = json.loads(html.unescape(found[1])), client[1]
        asked = dict.fromkeys(("client_id", "document_id", "tab_id"), self._id)
        root = self._base.rstrip("/")
        server, path = root.rsplit("/", 1)
        await self._socket.connect(
            f"{server}/?{urlencode({**asked, 'next_message_id': 0, 'implicit_handshake': 'true'})}",
            socketio_path=f"/{path}/_nicegui_ws/socket.io",
            transports=["websocket"],
            wait_timeout=HANG_S,
        )

    async def close(self) -> None:
        """Leave the page."""
        await self._socket.disconnect()

    async def send(self, chance: Random, count: int) -> None:
        """Send events: most are of elements that there are, or were, with arguments that nobody expects."""
        for _ in range(count):
            if not self._socket.connected:
                await self.open()
            await self._socket.emit(*self._event(chance))

    def _event(self, chance: Random) -> tuple[str, object]:
        heard = [(key, one["listener_id"]) for key, it in self._elements.items() for one in it.get("events", ())]
        self._stale = (self._stale + heard)[-5_000:]
        element, listener = chance.choice(chance.choice([heard or self._stale, self._stale]))
        if chance.random() < 0.05:
            element = chance.choice([*self._elements])
        tag = self._elements.get(element, {}).get("tag", "")
        named = {"id": int(element), "client_id": self._id, "listener_id": listener}
        message: object = {**named, "args": _arguments(chance, tag)}
        if chance.random() < 0.05:
            message = _bent(chance, {**named, "args": []})
        return (
            "event" if chance.random() < 0.97 else chance.choice(["ack", "javascript_response", "log", "x"])
        ), message

    async def _updated(self, message: dict[str, Any]) -> None:
        for key, element in message.items():
            if isinstance(element, dict):
                self._elements[key] = element
            else:
                self._elements.pop(key, None)


def hostile_value(chance: Random, depth: int = 0) -> object:
    """Return something that JSON can say."""
    kinds = _KINDS if depth < _DEEPEST else _KINDS[:-2]
    return chance.choice(kinds)(chance, depth)


def _text(chance: Random, _: int) -> str:
    return "x" * _LONG if chance.random() < 0.01 else chance.choice([*NAMES, *_WORDS, *_TYPED])


def _from_the_board(chance: Random, _: int) -> object:
    return {"x": chance.randrange(-1, 9), "y": chance.randrange(-1, 9), "name": f"R{chance.randrange(9)}"}


def _list(chance: Random, depth: int) -> object:
    return [hostile_value(chance, depth + 1) for _ in range(chance.randrange(4))]


def _object(chance: Random, depth: int) -> object:
    return {
        chance.choice([*NAMES, "value", "key"]): hostile_value(chance, depth + 1) for _ in range(chance.randrange(4))
    }


_KINDS: tuple[Callable[[Random, int], object], ...] = (
    lambda chance, _: chance.choice(_NUMBERS),
    lambda chance, _: chance.randrange(-2, 12),
    lambda chance, _: chance.choice([None, True, False]),
    _text,
    _from_the_board,
    _list,
    _object,
)


def _option(chance: Random) -> object:
    return {"value": chance.choice([0, 1, 2, 3, -1, 10**6, True, None, 0.5]), "label": chance.choice(NAMES)}


def _key(chance: Random) -> object:
    action = {name: chance.random() < 0.5 for name in ("keydown", "keyup", "repeat")}
    pressed = {name: chance.random() < 0.5 for name in ("altKey", "ctrlKey", "shiftKey", "metaKey")}
    return {"action": action, "key": chance.choice(["z", "Z", *NAMES]), "code": "KeyZ", "location": 0, **pressed}


_FORMS: dict[str, Callable[[Random], object]] = {
    "nicegui-select": lambda chance: chance.choice([_option(chance), [_option(chance) for _ in range(3)]]),
    "q-btn-toggle": _option,
    "q-option-group": lambda chance: chance.choice([0, 1, 2, -1, 10**6, None]),
    "nicegui-input": lambda chance: chance.choice([*NAMES, *_TYPED]),
    "nicegui-number": lambda chance: chance.choice([*_NUMBERS, *_TYPED]),
    "q-slider": lambda chance: chance.choice([*_NUMBERS, *_TYPED, None, True]),
    "nicegui-keyboard": _key,
}
"""What elements of a kind send, as far as its form goes."""


def _arguments(chance: Random, tag: str) -> object:
    if chance.random() < 0.05:
        return hostile_value(chance)
    if chance.random() < 0.6 and tag in _FORMS:
        return [json.dumps(_FORMS[tag](chance))]
    return [
        chance.choice(_RAW) if chance.random() < 0.05 else json.dumps(hostile_value(chance))
        for _ in range(chance.choice([0, 1, 1, 1, 1, 1, 2, 3]))
    ]


def _bent(chance: Random, message: dict[str, object]) -> object:
    """Return a message of which something is missing, or is something else; or no message at all."""
    if chance.random() < 0.2:
        return hostile_value(chance)
    bent = dict(message)
    key = chance.choice([*bent])
    if chance.random() < 0.5:
        del bent[key]
    else:
        bent[key] = hostile_value(chance)
    return bent


def faults_of_ours(log: str) -> Iterator[str]:
    """Yield the entries of an `errors.log` whose error was raised below a line of the application."""
    for entry in re.split(r"(?m)^(?=\d{4}-\d\d-\d\d \d\d:\d\d:\d\d)", log):
        lines = re.findall(r'File "[^"]*[/\\]robochoc[/\\]([^"]*)", line', entry)
        if any(line not in {"app/guard.py", "app/server.py"} for line in lines):
            yield entry
