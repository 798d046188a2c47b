"""Captions in words for the epochs of a run: the scene would tell what has happened as the files of the team do."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import msgspec

from robochoc.app.flights.flight_map import happened_in
from robochoc.app.foreign.facts import events_in_words
from robochoc.app.runs.options import RESULT
from robochoc.app.runs.run import MAX_RESULT, Run
from robochoc.formats import InvalidInputError, read_team


def captioned(run: Run) -> bytes | None:
    """Return the result of a run with what has happened in words; None: nothing has, or it is not known."""
    with suppress(OSError, ValueError, TypeError, LookupError, msgspec.MsgspecError, RecursionError, InvalidInputError):
        happened = _happened(run)
        file = run.folder / RESULT
        if not happened or file.stat().st_size > MAX_RESULT:
            return None
        result: dict[str, Any] = msgspec.json.decode(file.read_bytes().partition(b"\n")[0], type=dict[str, Any])
        first, *others = result["epochs"]
        if len(others) != len(happened):
            return None
        result["epochs"] = [first, *({**one, "opened_by": told} for one, told in zip(others, happened, strict=True))]
        return msgspec.json.encode(result) + b"\n"
    return None


def _happened(run: Run) -> list[str]:
    """Return what has happened before each epoch but the first one, without a full stop."""
    if run.sketch.decisions:
        told = happened_in(run)
        return [" ".join(told).removesuffix(".")] if told else []
    return [told.removesuffix(".") for told in events_in_words(read_team(run.team))]
