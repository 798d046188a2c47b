"""Who is let in: browsers of this machine that know the path, and no other page in them."""

from __future__ import annotations

import asyncio
from collections.abc import MutableMapping
from typing import Any

import pytest
from starlette.requests import Request
from starlette.responses import PlainTextResponse

from robochoc.app import guard
from robochoc.app.guard import AccessGuard, Served
from tests.support.cases import looped

SECRET = "secret"  # noqa: S105 - of a test
HERE = b"127.0.0.1:8000"
SAME = {"host": HERE, "origin": b"http://" + HERE}
_PIECE = 1 << 20


async def _inside(scope: MutableMapping[str, Any], _receive: object, send: Any) -> None:  # noqa: ANN401 - ASGI's
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
    else:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"inside"})


def _asked(
    path: str,
    headers: dict[str, bytes],
    *,
    kind: str = "http",
    method: str = "GET",
    served: Served = _inside,
    sends: int = 0,
) -> list[dict[str, Any]]:
    """What is answered to a request that sends so many bytes, in pieces without an end."""
    left = sends
    answers: list[dict[str, Any]] = []

    async def send(message: MutableMapping[str, Any]) -> None:
        answers.append(dict(message))

    async def receive() -> MutableMapping[str, Any]:
        nonlocal left
        piece = min(left, _PIECE)
        left -= piece
        return {"type": f"{kind}.request", "body": bytes(piece), "more_body": left > 0}

    named = [(name.encode(), value) for name, value in headers.items()]
    scope = {"type": kind, "path": path, "headers": named} | ({"method": method} if kind == "http" else {})
    asyncio.run(AccessGuard(served, SECRET, 8000)(scope, receive, send))
    return answers


def test_a_request_with_a_late_body_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "PART_S", 0.01)
    answers: list[dict[str, Any]] = []

    async def reads(scope: MutableMapping[str, Any], receive: Any, send: Any) -> None:  # noqa: ANN401 - ASGI's
        await PlainTextResponse(await Request(scope, receive).body())(scope, receive, send)

    async def send(message: MutableMapping[str, Any]) -> None:
        answers.append(dict(message))

    async def receive() -> MutableMapping[str, Any]:
        if answers:
            return {"type": "http.disconnect"}
        await asyncio.Event().wait()
        raise AssertionError

    named = [(name.encode(), value) for name, value in SAME.items()]
    scope = {"type": "http", "path": "/secret/", "headers": named, "method": "POST"}
    asyncio.run(AccessGuard(reads, SECRET, 8000)(scope, receive, send))
    assert answers[0]["status"] == 408


def test_a_browser_of_this_machine_with_the_path_is_served() -> None:
    first, body = _asked("/secret/", SAME)
    assert (first["status"], body["body"]) == (200, b"inside")


@looped("host", [b"evil.example:8000", b"127.0.0.1", b"127.0.0.1:8001", b"", b"secret"])
def test_another_name_of_this_machine_is_not_found(host: bytes) -> None:
    first, body = _asked("/secret/", {"host": host})
    assert first["status"] == 404
    assert b"Each start of robochoc app has a new address" in body["body"]


@looped("path", ["/", "", "/secre/", "/secrets/", "/x/secret/", "//secret/", "/SECRET/", "/sécret/"])
def test_without_the_secret_path_nothing_is_found(path: str) -> None:
    assert _asked(path, {"host": HERE})[0]["status"] == 404


@looped("origin", [b"https://evil.example", b"null", b"http://127.0.0.1:8001", b"https://" + HERE])
def test_a_page_of_another_site_is_refused(origin: bytes) -> None:
    assert _asked("/secret/", {"host": HERE, "origin": origin})[0]["status"] == 403


@looped(
    ("path", "headers"),
    [
        ("/secret/_nicegui_ws/", {"host": HERE, "origin": b"http://evil.example"}),
        ("/_nicegui_ws/", {"host": HERE}),
        ("/secret/_nicegui_ws/", {"host": b"evil.example"}),
    ],
)
def test_its_sockets_are_refused_as_well(path: str, headers: dict[str, bytes]) -> None:
    assert _asked(path, headers, kind="websocket") == [{"type": "websocket.close", "code": 1008}]


def test_a_socket_of_its_own_page_is_accepted() -> None:
    assert _asked("/secret/ws", SAME, kind="websocket") == [{"type": "websocket.accept"}]


def test_answers_may_not_be_kept_nor_framed_elsewhere() -> None:
    headers = dict(_asked("/secret/", {"host": HERE})[0]["headers"])
    assert headers[b"cache-control"] == b"no-store"
    assert headers[b"x-frame-options"] == b"SAMEORIGIN"
    assert headers[b"referrer-policy"] == b"no-referrer"


@looped("method", ["PUT", "DELETE", "OPTIONS", "TRACE", "PROPFIND", "get", ""])
def test_other_methods_are_refused(method: str) -> None:
    assert _asked("/secret/", {"host": HERE}, method=method)[0]["status"] == 405


@looped("length", [b"%d" % (guard.MOST_BYTES + 1), b"9" * 5_000, b"-1", b"1e3", b"0x10"])
def test_what_is_too_long_is_refused_before_it_is_read(length: bytes) -> None:
    told = _asked("/secret/", {"host": HERE, "content-length": length}, method="POST")
    assert (told[0]["status"], len(told)) == (413, 2)


async def _reads(scope: MutableMapping[str, Any], receive: Any, send: Any) -> None:  # noqa: ANN401 - ASGI's
    body = await Request(scope, receive).body()
    await PlainTextResponse(str(len(body)))(scope, receive, send)


@pytest.mark.parametrize(("sends", "status"), [(3 * _PIECE, 200), (3 * _PIECE + 1, 413)])
def test_what_does_not_say_how_long_it_is_is_counted(monkeypatch: pytest.MonkeyPatch, sends: int, status: int) -> None:
    monkeypatch.setattr(guard, "MOST_BYTES", 3 * _PIECE)
    told = _asked("/secret/", {"host": HERE}, method="POST", served=_reads, sends=sends)
    assert told[0]["status"] == status
    assert [one["type"] for one in told] == ["http.response.start", "http.response.body"]


@pytest.mark.parametrize(("left", "why"), [(True, "another"), (False, "No response returned.")])
def test_what_goes_wrong_is_no_less_wrong_for_a_page_that_was_left(*, left: bool, why: str) -> None:
    with pytest.raises(RuntimeError, match=why):
        _failing(left=left, why=why)


def test_a_page_that_was_left_before_it_was_made_is_no_fault() -> None:
    _failing(left=True, why="No response returned.")


def _failing(*, left: bool, why: str) -> None:
    """Serve a request with an application that fails, once it has heard whether its sender has gone."""

    async def fails(_scope: object, receive: Any, _send: object) -> None:  # noqa: ANN401 - ASGI's
        await receive()
        raise RuntimeError(why)

    async def receive() -> MutableMapping[str, Any]:
        return {"type": "http.disconnect"} if left else {"type": "http.request", "body": b"", "more_body": False}

    async def send(_message: object) -> None:
        """Nobody listens."""

    scope = {"type": "http", "path": "/secret/", "headers": [(b"host", HERE)], "method": "GET"}
    asyncio.run(AccessGuard(fails, SECRET, 8000)(scope, receive, send))


def test_a_page_loads_nothing_from_elsewhere_unless_it_says_what() -> None:
    policy = dict(_asked("/secret/", {"host": HERE})[0]["headers"])[b"content-security-policy"].decode()
    assert f"connect-src 'self' ws://{HERE.decode()};" in policy
    assert "http:" not in policy
    assert "*" not in policy

    async def own(scope: MutableMapping[str, Any], receive: Any, send: Any) -> None:  # noqa: ANN401 - ASGI's
        await PlainTextResponse("", headers={"Content-Security-Policy": "sandbox"})(scope, receive, send)

    headers = _asked("/secret/", {"host": HERE}, served=own)[0]["headers"]
    assert [value for name, value in headers if name == b"content-security-policy"] == [b"sandbox"]
