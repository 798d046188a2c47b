"""Messages in words, such as `Robot2.1 says: as long as V1.1 = 2, V2.1 cannot be 3`.

The words are defined in the message's class (`Message.in_words`). If there are no words, or the protocol is not
installed, the message is shown by its type, FIPA act and fields, so that any journal can be shown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, overload

from robochoc.formats import InvalidInputError
from robochoc.journal.entries import Header, JournalEntry
from robochoc.journal.events import Began, Given, Sent
from robochoc.journal.team_events import GivenProblemError, TeamReader
from robochoc.model.problem import Team
from robochoc.protocols.acts import INFORM
from robochoc.protocols.message import Message
from robochoc.protocols.wording import Wording
from robochoc.replay.run_names import RunNames, run_names
from robochoc.replay.sentences import fields_in_words, sentence_of
from robochoc.sniffer.recorded_messages import installed_protocol, message_of, types_by_name

ValueLabel = Callable[[str, int], str]
"""Returns the name for a variable's value."""


class JournalSentences:
    """Follows a journal entry by entry, and returns its messages in words. Only names are stored.

    `called` returns the names for values. None: values are shown as in the journal, and symbols by their names. `team`
    is the first team of the journal, if it is known: then its files are not parsed.
    """

    def __init__(self, called: ValueLabel | None = None, team: Team | None = None) -> None:
        self._called = called
        self._known = team
        self._unread: list[Given] = []
        self._reader = TeamReader()
        self._requested = self._protocol = ""
        self._types: Mapping[str, type[Message]] = {}
        self._on_tree = False
        self._names = RunNames()

    def follow(self, entry: JournalEntry) -> None:
        """Update the current protocol, and the names of the robots and their variables."""
        match entry:
            case Header():
                self._requested = entry.protocol
                self._set_protocol(entry.protocol)
            case Began():
                self._set_protocol(entry.protocol)
            case Given():
                self._given(entry)
            case _:
                pass

    def sentence(self, sent: Sent) -> str:
        """Return a message as a sentence spoken by its sender."""
        words = self._names.wording(sent.sender, sent.receiver, on_tree=self._on_tree)
        return sentence(sent.type, sent.content, words, self._types.get(sent.type))

    def _set_protocol(self, protocol: str) -> None:
        if protocol == self._protocol:
            return
        self._protocol = protocol
        found = installed_protocol(protocol, self._requested)
        self._types = types_by_name(found[1]) if found else {}
        self._on_tree = found is not None and found[1].traits.tree

    def _given(self, given: Given) -> None:
        try:
            names = run_names(self._team(given), on_tree=self._on_tree)
        except (GivenProblemError, InvalidInputError, ValueError):
            names = RunNames()
        self._names = names if self._called is None else names._replace(symbols=_SymbolNames(self._called))

    def _team(self, given: Given) -> Team:
        known, self._known = self._known, None
        # Another order has other links, which determine the tree.
        if known and (given.order == known.order if self._on_tree else sorted(given.order) == sorted(known.order)):
            self._unread.append(given)  # a later event has only the files that differ
            return replace(known, robots=tuple(known[name] for name in given.order))
        for earlier in self._unread:
            self._reader.team(earlier)
        self._unread.clear()
        return self._reader.team(given)


class _SymbolNames(Mapping[str, Sequence[str]]):
    """The names for the values of all variables."""

    def __init__(self, called: ValueLabel) -> None:
        self._called = called

    def __getitem__(self, variable: str) -> Sequence[str]:
        return _ValueNames(self._called, variable)

    def __iter__(self) -> Iterator[str]:
        return iter(())

    def __len__(self) -> int:
        return 0


class _ValueNames(Sequence[str]):
    """The names for the values of one variable: item n is the name for value n (n >= 0)."""

    def __init__(self, called: ValueLabel, variable: str) -> None:
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


def sentence(kind: str, content: Mapping[str, Any], words: Wording, message_type: type[Message] | None) -> str:
    """Return a recorded message as a sentence spoken by its sender.

    Args:
        kind: The name of the message type.
        content: The recorded fields by name.
        words: The message's sender and receiver, and the names in the team.
        message_type: The message class. None: the protocol is not installed or lacks this type.
    """
    message = message_of(message_type, content) if message_type else None
    if message is not None:
        return sentence_of(message, words, content)
    return fields_in_words(kind, content, words.sender, message_type.act if message_type else INFORM)
