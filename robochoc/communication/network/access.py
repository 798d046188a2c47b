"""Access control for writing and reading, by zenoh's rules: deny by default, bound to the name in a certificate.

The key of a frame is `rc/msg/RECEIVER/SENDER`. A robot may write only to keys that end with its name, and read only
keys that begin with it, so that nobody can write in another's name or read another's frames. Among the keys that end
with its name, it may use the key of the master, and after the team is closed also the keys of its receivers. Recovery
(zenoh's advanced publishers) requests missed frames under `@adv` below the same keys, and follows the same rules.

The journal is requested on `rc/journal/NAME`, and only by NAME, if it has the right to sniff. The master answers.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from robochoc.communication.network.framing import MASTER
from robochoc.formats.names import is_name

ALL = "*"
"""All participants."""


def frame_key(receiver: str, sender: str) -> str:
    """Return the key of frames from `sender` to `receiver`."""
    return f"rc/msg/{receiver}/{sender}"


def life_key(name: str) -> str:
    """Return the liveliness token of `name`."""
    return f"rc/live/{name}"


def journal_key(name: str) -> str:
    """Return the key on which `name` requests the run's journal."""
    return f"rc/journal/{name}"


def name_in(key: str) -> str:
    """Return the name in the key of a frame (its sender), in a liveliness token, or in a request for the journal."""
    return key.rpartition("/")[2]


def access_control(
    reach: Mapping[str, Sequence[str]], sniffers: Collection[str] | None = None, master: str = MASTER
) -> dict[str, Any]:
    """Return zenoh's `access_control`: each participant in `reach` may write to the master and its own receivers.

    The `sniffers` among them may request the journal from the master (None: no one may). The certificate of the leading
    master has the name `master`; on the network, it is always called `MASTER`.
    Raises `ValueError` for names with a special meaning in keys: `*` could write in everyone's name.
    """
    strange = next((name for name in reach if not is_name(name) or name == MASTER), None)
    if strange is not None:
        raise ValueError(
            f"{strange!r} is not a valid name of a robot on a network: use a letter, then letters, digits, '.' and '_'"
        )
    rules: list[dict[str, Any]] = []
    policies = []
    for name, others in {**reach, MASTER: [ALL]}.items():
        receivers = [ALL] if ALL in others else dict.fromkeys([MASTER, *others])
        mine = _rules(name, [frame_key(other, name) for other in receivers])
        if sniffers is not None and name in sniffers:
            mine += _sniffing(name, journal_key(name), asks="ingress", answers="egress")
        elif sniffers is not None and name == MASTER:
            mine += _sniffing(name, journal_key(ALL), asks="egress", answers="ingress")
        rules += mine
        policies.append({"rules": [rule["id"] for rule in mine], "subjects": [name]})
    subjects = [{"id": name, "cert_common_names": [name]} for name in reach]
    subjects.append({"id": MASTER, "cert_common_names": [master]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def journal_qos() -> dict[str, Any]:
    """Return zenoh's `qos` for the journal: its priority is lower than that of frames, and slow sniffers lose pieces.

    Answers have the priority of the request, and a sniffer might request a blocking answer and then stop reading.
    """
    return {
        "id": "the journal yields",
        "messages": ["query"],
        "key_exprs": [journal_key(ALL)],
        "flows": ["ingress", "egress"],
        "overwrite": {"congestion_control": "drop", "priority": "background"},
    }


def _rules(name: str, written: Sequence[str]) -> list[dict[str, Any]]:
    """Return the rules for `name`, which writes frames to the keys `written`."""
    read = [frame_key(name, ALL)]
    sends = ["put", "reply", "declare_queryable", "liveliness_token"]
    hears = ["declare_subscriber", "query", "declare_liveliness_subscriber", "liveliness_query", "liveliness_token"]
    return [
        _rule(f"{name} writes", "ingress", sends, [*written, *map(_recovery, written)]),
        _rule(f"{name} reads", "ingress", hears, [*read, *map(_recovery, read)]),
        _rule(f"{name} receives", "egress", sends, [*read, *map(_recovery, read)]),
        _rule(f"{name} is asked", "egress", hears, [frame_key(ALL, ALL), _recovery(frame_key(ALL, ALL))]),
        _rule(f"{name} lives", "ingress", ["liveliness_token"], [life_key(name)]),
        _rule(f"{name} watches", "ingress", ["declare_liveliness_subscriber", "liveliness_query"], [life_key(ALL)]),
        _rule(f"{name} sees", "egress", ["liveliness_token"], [life_key(ALL)]),
    ]


def _sniffing(name: str, key: str, *, asks: str, answers: str) -> list[dict[str, Any]]:
    """Return the rules for requests on `key` in the direction `asks`, and for answers in the direction `answers`."""
    return [
        _rule(f"{name} sniffs: questions", asks, ["query"], [key]),
        _rule(f"{name} sniffs: answers", answers, ["reply", "declare_queryable"], [key]),
    ]


def _recovery(key: str) -> str:
    return f"{key}/@adv/**"


def _rule(name: str, flow: str, messages: list[str], keys: list[str]) -> dict[str, Any]:
    return {"id": name, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys}
