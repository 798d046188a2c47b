"""The states of a team in words: values, messages in transit, steps."""

from __future__ import annotations

from robochoc.communication.host import message_decoder
from robochoc.exploration.stage import Stage
from robochoc.exploration.state_graph import StateGraph
from robochoc.exploration.team_state import LOST, Delivery, TeamState
from robochoc.replay.inspection import safely
from robochoc.replay.run_names import run_names
from robochoc.replay.sentences import sentence_of


class StateTexts:
    """Describes the states of `graph`."""

    def __init__(self, graph: StateGraph) -> None:
        self._graph = graph
        self._names: dict[int, _MessageTexts] = {}

    def message(self, state: TeamState, receiver: int, sender: int, number: int) -> str:
        """Return a message in transit in words, without its sender. `number` is its number in a queue."""
        if state.stage not in self._names:
            self._names[state.stage] = _MessageTexts(self._graph.stage_of(state))
        return self._names[state.stage].text(sender, receiver, self._graph.content(number))

    def step(self, before: TeamState, delivery: Delivery) -> str:
        """Return a step from the state `before` in words, with its messages."""
        if not delivery.receiver:
            return f"{delivery.in_words[:1].upper()}{delivery.in_words[1:]}"
        places = self._graph.stage_of(before).places
        receiver = places[delivery.receiver]
        waiting = {
            sender: [number for number in queue if number != LOST]
            for (to, sender), queue in before.queues
            if to == receiver
        }
        said = [
            f"from {sender}: {self.message(before, receiver, places[sender], waiting[places[sender]].pop(0))}"
            for sender in delivery.senders
        ]
        verb = "does not receive, because it is lost," if delivery.lost else "receives"
        return f"{delivery.receiver} {verb} {'; '.join(said)}"


class _MessageTexts:
    """Returns the messages of a stage in words."""

    def __init__(self, stage: Stage) -> None:
        self._order = stage.names
        self._on_tree = stage.traits.tree
        self._names = run_names(stage.judge.team, on_tree=self._on_tree)
        self._decode = message_decoder(stage.protocol.messages).decode

    def text(self, sender: int, receiver: int, content: bytes) -> str:
        name = self._order[sender]
        words = self._names.wording(name, self._order[receiver], on_tree=self._on_tree)
        said = safely(lambda: sentence_of(self._decode(content), words), "a message that cannot be decoded")
        return str(said).removeprefix(f"{name} says").removeprefix(":").lstrip()
