"""`robochoc directory`: queries a running master's Directory Facilitator."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.network import (
    identity_option,
    masters_option,
    network_errors_as_failures,
    patience_option,
    token_options,
)
from robochoc.cli.options.value_types import WholeNumber

if TYPE_CHECKING:
    from robochoc.run.networked.address import Address
    from robochoc.services.descriptions import AgentDescription


@click.command()
@masters_option("--master", "places", "Address of the master; several, if there are standby masters.", required=True)
@click.option("--as", "name", required=True, metavar="NAME", help="Your enrolled name (--role observer is sufficient).")
@token_options()
@identity_option
@click.option(
    "--search",
    "slots",
    multiple=True,
    metavar="SLOT=VALUE",
    help=(
        "Only agents that match: protocol=abt, variable=V3.1, topic=..., name=Robot3.1, ontology=..., language=..."
        " Repeatable: all must match."
    ),
)
@patience_option("Time without contact after which the master counts as lost.", 10.0)
@click.option("--at-most", type=WholeNumber(1), metavar="N", help="List at most N agents.")
@click.option("--watch", "watching", is_flag=True, help="Print agents that register and leave, until Ctrl-C.")
@click.option("--sl", is_flag=True, help="Print the answer in FIPA-SL0, as it is received.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per agent.")
def directory(
    places: tuple[Address, ...],
    name: str,
    token: str | None,
    identity: Path | None,
    *,
    sl: bool,
    as_json: bool,
    watching: bool,
    **given: Any,  # noqa: ANN401 - the query, and how long to wait
) -> None:
    """List the agents in a running master's Directory Facilitator, with their protocols, variables and topics.

    \b
    robochoc directory --master 192.168.1.14:7447 --as Scout --search protocol=abt
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    if sl and as_json:
        raise click.UsageError("--sl cannot be used with --json; remove one")
    with network_errors_as_failures(places[0]):
        from robochoc.run.networked.directory_query import agents_in, query_directory, search_request, watch_directory
        from robochoc.run.networked.join import identity_of
        from robochoc.run.networked.leader_search import at_leader

        words = partial(search_request, slots=given["slots"], at_most=given["at_most"])
        words(places[0])  # an invalid template is reported before the token is used
        patience_s = given["patience_s"]
        proof = identity_of(name, places[0], identity, token, patience_s)

        def watch(place: Address) -> Iterator[str]:
            """Wait for the first notice, which comes at once, and return all notices."""
            notices = watch_directory(place, proof, words(place), patience_s)
            return chain([next(notices)], notices)

        if watching:
            for answer in at_leader(places, patience_s, watch):
                _print_answer(answer, sl=sl, as_json=as_json)
            return
        answer = at_leader(places, patience_s, lambda place: query_directory(place, proof, words(place), patience_s))
        if sl or as_json:
            _print_answer(answer, sl=sl, as_json=as_json)
        else:
            _print_table(agents_in(answer))


def _print_answer(answer: str, *, sl: bool, as_json: bool) -> None:
    """Print one answer line by line. For an agent that has left, only the name is printed."""
    import msgspec

    from robochoc.run.networked.directory_query import agents_in, subject_of
    from robochoc.system.plain_text import on_one_line

    if sl:
        click.echo(on_one_line(answer, len(answer)))
        return
    agents = agents_in(answer)
    for agent in agents:
        kinds = ", ".join(f"{service.type} {service.name}" for service in agent.services)
        click.echo(msgspec.json.encode(agent).decode() if as_json else on_one_line(f"{agent.name}: {kinds}"))
    gone = "" if agents else subject_of(answer)
    if gone:
        fields = msgspec.json.encode({"name": gone, "gone": True}).decode()
        click.echo(fields if as_json else on_one_line(f"{gone} has left"))


def _print_table(agents: tuple[AgentDescription, ...]) -> None:
    from robochoc.cli.reports.table import print_table

    if not agents:
        click.echo("no agent matches")
        return
    rows = []
    for agent in agents:
        kinds = {
            kind: [service.name for service in agent.services if service.type == kind] for kind in ("variable", "topic")
        }
        rows.append((agent.name, *map(", ".join, (agent.protocols, kinds["variable"], kinds["topic"]))))
    print_table(("agent", "protocols", "variables", "topics"), rows)
