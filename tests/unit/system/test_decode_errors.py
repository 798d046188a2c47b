"""What msgspec refuses, in plain words: what is wrong, where, what was expected, and what is allowed."""

from __future__ import annotations

from typing import Literal

import msgspec
import pytest

from robochoc.model.outcome import Verdict
from robochoc.system.decode_errors import describe_decode_error
from tests.support.cases import cases


class Part(msgspec.Struct):
    verdict: Verdict
    number: int = 0


class Whole(msgspec.Struct, forbid_unknown_fields=True):
    name: str
    parts: list[Part] = []
    by_name: dict[str, Part] = {}
    count: int | None = None
    letter: Literal["p", "q"] = "p"
    pair: tuple[int, int] = (1, 2)


VERDICTS = "allowed: solution, optimal, no-solution, unknown"


def test_what_is_wrong_where_and_what_is_allowed() -> None:
    with cases() as each:
        for content, message in [
            ('{"name": 1}', "name: expected a text, found an integer"),
            ("{}", "the field 'name' is missing"),
            ("[]", "expected an object, found a list"),
            (
                '{"name": "", "other": 1}',
                "there is no field 'other'; allowed: name, parts, by_name, count, letter, pair",
            ),
            ('{"name": "", "parts": [{"verdict": "Z"}]}', f"parts[0].verdict: 'Z' is not allowed; {VERDICTS}"),
            (
                '{"name": "", "by_name": {"x": {"verdict": "Z"}}}',
                f"by_name[...].verdict: 'Z' is not allowed; {VERDICTS}",
            ),
            ('{"name": "", "letter": "r"}', "letter: 'r' is not allowed; allowed: p, q"),
            ('{"name": "", "count": 1.5}', "count: expected an integer or null, found a number"),
            ('{"name": "", "pair": [1]}', "pair: expected a list of length 2"),
            ('{"name": ', "it is not valid JSON: it ends too early"),
            ('{"name" 1}', "it is not valid JSON: expected ':' (byte 8)"),
        ]:
            with each(content):
                with pytest.raises(msgspec.MsgspecError) as caught:
                    msgspec.json.decode(content, type=Whole)
                assert describe_decode_error(caught.value, Whole) == message
