"""Words for the messages of a journal that is read once, entry by entry. Nothing is kept but names."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import overload

from robochoc.formats import InvalidInputError
from robochoc.journal.entries import Header, JournalEntry
from robochoc.journal.events import Began, Given, Sent
from robochoc.journal.given import GivenProblemError, TeamReader
from robochoc.protocols.message import Message
from robochoc.sniffer.recorded_messages import installed_protocol, types_by_name
from robochoc.sniffer.sentences import sentence
from robochoc.sniffer.team_names import RunNames, run_names

Called = Callable[[str, int], str]
"""How the value of a variable is called."""


class Spoken:
    """Follows a journal, and returns its messages in words, as in the sniffer.

    `called` tells values as the reader knows them. None: as they stand in the journal, symbols by their names.
    """

    def __init__(self, called: Called | None = None) -> None:
        self._called = called
        self._reader = TeamReader()
        self._asked = self._protocol = ""
        self._types: Mapping[str, type[Message]] = {}
        self._on_tree = False
        self._names = RunNames()

    def follow(self, entry: JournalEntry) -> None:
        """Take notice of which protocol speaks, and of what the robots and their variables are called."""
        match entry:
            case Header():
                self._asked = entry.protocol
                self._speaks(entry.protocol)
            case Began():
                self._speaks(entry.protocol)
            case Given():
                self._given(entry)
            case _:
                pass

    def sentence(self, sent: Sent) -> str:
        """Return a message as a sentence of its sender."""
        words = self._names.wording(sent.sender, sent.receiver, on_tree=self._on_tree)
        return sentence(sent.type, sent.content, words, self._types.get(sent.type))

    def _speaks(self, protocol: str) -> None:
        if protocol == self._protocol:
            return
        self._protocol = protocol
        found = installed_protocol(protocol, self._asked)
        self._types = types_by_name(found[1]) if found else {}
        self._on_tree = found is not None and found[1].traits.tree

    def _given(self, given: Given) -> None:
        try:
            names = run_names(self._reader.team(given), on_tree=self._on_tree)
        except (GivenProblemError, InvalidInputError, ValueError):
            names = RunNames()
        self._names = names if self._called is None else names._replace(symbols=_Symbols(self._called))


class _Symbols(Mapping[str, Sequence[str]]):
    """What the values of all variables are called."""

    def __init__(self, called: Called) -> None:
        self._called = called

    def __getitem__(self, variable: str) -> Sequence[str]:
        return _Values(self._called, variable)

    def __iter__(self) -> Iterator[str]:
        return iter(())

    def __len__(self) -> int:
        return 0


class _Values(Sequence[str]):
    """What the values of one variable are called: each number that is no negative one is at its place."""

    def __init__(self, called: Called, variable: str) -> None:
        self._called, self._variable = called, variable

    @overload
    def __getitem__(self, place: int) -> str: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[str]: ...
    def __getitem__(self, place: int | slice) -> str | Sequence[str]:
        if isinstance(place, slice):
            raise TypeError("values are looked up one by one")
        return self._called(self._variable, place)

    def __len__(self) -> int:
        return 2**62
