"""Spoil valid inputs: bytes, text, XML, JSON and msgpack, each with its structure in view."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

import msgspec
from lxml import etree

Mutation = Callable[[Random, bytes], bytes]

LARGEST = 1 << 18
"""Bytes that a mutated input may have: what takes long because it is long is no finding."""
NUMBERS = (
    *(-1, 0, 1, 2, 3, 7, 100, 127, 128, 255, 256, 65535, 2**31 - 1, 2**31, 2**32, 2**53, 2**53 + 1),
    *(2**63 - 1, 2**63, 2**64 - 1, -(2**31), -(2**53) - 1, -(2**63)),
)
WORDS = (
    *("", " ", "0", "-1", "1..0", "1..1000000000", "-5..5", "1..3 2..4", "9" * 5000, "1e9", "+1", "٣", "0x10", "1_0"),
    *("infinity", "-infinity", "nan", "solved", "100 cycles", "TKC", "PKC", "DisCSP", "DisWCSP", "soft", "supports"),
    *("MASTER", "*", "a/b", "../a", "/", ".", "..", "@", "$", "x" * 300, "\x1b[2J", "\u202e", "\u2028", "\x00", "\x7f"),
    *("\ud800", "\ufffe", "é", "a b", "a|b", "1:2 3", "1 2|3 4", "((", "))", '"', "\\", '#9999999"', "%s", "{}"),
    "late/../x",
    *("eq(X,Y)", "pow(2,pow(2,2))", "div(1,0)", "not(" * 60, "add(1,2", "true", "1)", "X", "int X int Y"),
)


def spoilt_bytes(chance: Random, content: bytes) -> bytes:
    """`content` with a few bytes changed, added or taken away."""
    made = bytearray(content or b"\x00")
    at = chance.randrange(len(made))
    match chance.randrange(9):
        case 0:
            made[at] ^= 1 << chance.randrange(8)
        case 1:
            made[at] = chance.randrange(256)
        case 2:
            made[at:at] = chance.randbytes(chance.choice((1, 2, 4, 16)))
        case 3:
            del made[at : at + chance.choice((1, 2, 4, 16, 256))]
        case 4:
            size = chance.choice((1, 2, 4, 8))
            number = chance.choice(NUMBERS) % (1 << 8 * size)
            made[at : at + size] = number.to_bytes(size, chance.choice(("little", "big")))
        case 5:
            other = chance.randrange(len(made))
            made[at:at] = made[other : other + chance.choice((1, 8, 64, 1024))]
        case 6:
            del made[at:]
        case 7:
            made[at:at] = made[at : at + chance.choice((1, 4, 16))] * chance.choice((2, 10, 1000))
        case _:
            made[at:at] = chance.choice(WORDS).encode("utf-8", "surrogatepass")
    return bytes(made[:LARGEST])


def spoilt_text(chance: Random, content: bytes) -> bytes:
    """`content` with a token of text left out, doubled, moved or replaced."""
    tokens = _tokens(content)
    if len(tokens) < 2:
        return spoilt_bytes(chance, content)
    at, other = chance.randrange(len(tokens)), chance.randrange(len(tokens))
    match chance.randrange(5):
        case 0:
            tokens[at] = tokens[other]
        case 1:
            del tokens[at]
        case 2:
            tokens[at:at] = tokens[other : other + chance.choice((1, 3, 20))]
        case 3:
            tokens[at] = chance.choice(WORDS).encode("utf-8", "surrogatepass")
        case _:
            tokens[at] = str(chance.choice(NUMBERS)).encode()
    return b"".join(tokens)[:LARGEST]


def _tokens(content: bytes) -> list[bytes]:
    """Words, and each other byte by itself."""
    found: list[bytes] = []
    word = b""
    for byte in content:
        one = bytes((byte,))
        if one.isalnum():
            word += one
        else:
            found += [word, one] if word else [one]
            word = b""
    return [*found, word] if word else found


def spoilt_xml(chance: Random, content: bytes) -> bytes:
    """The document `content` with an element, an attribute or a text changed, if it is one."""
    try:
        root = etree.fromstring(content, etree.XMLParser(resolve_entities=False, no_network=True))
    except (etree.XMLSyntaxError, ValueError):
        return spoilt_text(chance, content)
    elements: list[Any] = list(root.iter(etree.Element))
    one, other = chance.choice(elements), chance.choice(elements)
    try:
        match chance.randrange(8):
            case 0 | 1 | 2:
                _spoil_attribute(chance, one, other)
            case 3 | 4:
                one.text = _word(chance, one.text, elements)
            case 5:
                if one is not root:
                    one.getparent().remove(one)
            case 6:
                for _ in range(chance.choice((1, 1, 2, 200))):
                    other.insert(chance.randrange(len(other) + 1), copy.deepcopy(one))
                    if len(list(root.iter())) > len(elements) + 1000:
                        break
            case _:
                one.tag = chance.choice((other.tag, "x", "{urn:x}x"))
    except ValueError:  # what no XML can hold
        return spoilt_text(chance, content)
    return etree.tostring(root, encoding="utf-8", xml_declaration=True)[:LARGEST]


def _spoil_attribute(chance: Random, one: Any, other: Any) -> None:  # noqa: ANN401 - lxml's elements
    names = [*one.attrib] or [*other.attrib] or ["name"]
    name = chance.choice(names)
    match chance.randrange(5):
        case 0:
            one.attrib.pop(name, None)
        case 1:
            one.set(name, chance.choice([*other.attrib.values(), ""]))
        case 2:
            one.set(chance.choice(("model", "cost", "weight", "xmlns:x", "variable", "file")), chance.choice(WORDS))
        case _:
            one.set(name, _word(chance, one.get(name), [one, other]))


def _word(chance: Random, old: str | None, elements: Sequence[Any]) -> str:
    words = (old or "").split()
    fresh = chance.choice(
        (
            chance.choice(WORDS),
            str(chance.choice(NUMBERS)),
            chance.choice([value for one in elements for value in one.attrib.values()] or ["x"]),
            (chance.choice(elements).text or "")[:200],
        )
    )
    if not words or chance.random() < 0.4:
        return fresh
    at = chance.randrange(len(words))
    words[at : at + chance.randrange(2)] = [fresh] * chance.choice((1, 1, 1, 50))
    return chance.choice((" ", "  ", "\n", "|")).join(words) if chance.random() < 0.2 else " ".join(words)


def spoilt_msgpack(chance: Random, content: bytes) -> bytes:
    """The msgpack value `content` with something in it changed, if it is one."""
    return _spoilt_value(chance, content, msgspec.msgpack.decode, msgspec.msgpack.encode)


def spoilt_json(chance: Random, content: bytes) -> bytes:
    """The JSON value `content` with something in it changed, if it is one."""
    return _spoilt_value(chance, content, msgspec.json.decode, msgspec.json.encode)


def _spoilt_value(
    chance: Random, content: bytes, decode: Callable[[bytes], Any], encode: Callable[[Any], bytes]
) -> bytes:
    try:
        whole = [decode(content)]
        places = list(_places(whole))
        holder, key = chance.choice(places)
        _spoil_at(chance, holder, key, [one[at] for one, at in chance.choices(places, k=4)])
        return encode(whole[0])[:LARGEST]
    except (msgspec.MsgspecError, ValueError, TypeError, OverflowError, RecursionError, LookupError):
        return spoilt_bytes(chance, content)


def _places(whole: Any) -> list[tuple[Any, Any]]:  # noqa: ANN401 - any value
    found: list[tuple[Any, Any]] = []
    waiting = [whole]
    while waiting:
        holder = waiting.pop()
        keys = range(len(holder)) if isinstance(holder, list) else list(holder)
        for key in keys:
            found.append((holder, key))
            if isinstance(holder[key], list | dict):
                waiting.append(holder[key])
    return found


def _spoil_at(chance: Random, holder: Any, key: Any, others: Sequence[Any]) -> None:  # noqa: ANN401 - any value
    old = holder[key]
    match chance.randrange(8):
        case 0:
            del holder[key]
        case 1:
            holder[key] = copy.deepcopy(chance.choice(others))
        case 2 if isinstance(holder, list):
            holder[key:key] = [copy.deepcopy(old) for _ in range(chance.choice((1, 1, 2, 1000)))]
        case 3 if isinstance(holder, dict):
            holder[chance.choice(WORDS)] = holder.pop(key)
        case 4 if isinstance(old, bytes):
            holder[key] = chance.choice((spoilt_msgpack, spoilt_bytes))(chance, old)
        case 4 if isinstance(old, str):
            holder[key] = spoilt_text(chance, old.encode("utf-8", "replace")).decode("utf-8", "replace")
        case _:
            holder[key] = chance.choice(
                (chance.choice(NUMBERS), chance.choice(WORDS), None, True, [], {}, [old], b"", 0.5, -1e300, [[]] * 9)
            )


def one_of(*mutations: Mutation) -> Mutation:
    """Any of `mutations`."""

    def spoilt(chance: Random, content: bytes) -> bytes:
        return chance.choice(mutations)(chance, content)

    return spoilt


def in_folder(mutation: Mutation) -> Mutation:
    """Spoil one of the files of a folder (see `folder_of`) by `mutation`; now and then, which files there are."""

    def spoilt(chance: Random, content: bytes) -> bytes:
        files = files_of(content)
        name = chance.choice(sorted(files))
        other = chance.choice(sorted(files))
        match chance.randrange(20):
            case 0:
                files[name] = files[other]
            case 1 if len(files) > 1:
                del files[name]
            case 2:
                files[chance.choice(("x.xml", "scenario.xml", "late/x.xml", "é.xml", "a b.xml"))] = files[name]
            case _:
                files[name] = mutation(chance, files[name])
        return folder_of(files)

    return spoilt


def folder_of(files: dict[str, bytes]) -> bytes:
    """A folder as one input."""
    return msgspec.msgpack.encode(files)


def files_of(content: bytes) -> dict[str, bytes]:
    """The files of `folder_of`; anything else is one file."""
    try:
        found = msgspec.msgpack.decode(content, type=dict[str, bytes])
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        found = {}
    return found or {"x.xml": content}
