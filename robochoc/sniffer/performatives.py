"""What a robot does by each message of a protocol, in FIPA's terms: a performative for each type of message.

Protocols know nothing of FIPA; this table is for those who watch, and for agents of other makes. docs/guides/acl.md
shows it.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from robochoc.services.communicative_acts import Performative


class Act(NamedTuple):
    """The performative of a type of message, and the reason."""

    performative: Performative
    why: str


ACTS: Mapping[str, Act] = MappingProxyType(
    {
        "Above": Act(Performative.INFORM, "the receiver comes to know the domains above it"),
        "Accept": Act(Performative.ACCEPT_PROPOSAL, "the partial assignment, or the offer, that was proposed is taken"),
        "AddLink": Act(Performative.SUBSCRIBE, "from now on the sender wants to be told the receiver's value"),
        "Back": Act(Performative.INFORM, "what `Token` asked for is done: who is in the tree by now"),
        "Backtrack": Act(
            Performative.REJECT_PROPOSAL, "the receiver's value, proposed with the CPA or path, will not do"
        ),
        "BacktrackCPA": Act(Performative.REJECT_PROPOSAL, "the CPA that was proposed comes back"),
        "Below": Act(Performative.INFORM, "the receiver comes to know the domains and charges below it"),
        "CPA": Act(Performative.PROPOSE, "a partial assignment, for the receiver to extend or to reject"),
        "CPAs": Act(Performative.PROPOSE, "partial assignments, for the receiver to extend or to drop"),
        "Cost": Act(Performative.INFORM, "the receiver comes to know bounds on what a subtree costs"),
        "Dimensions": Act(Performative.INFORM, "the receiver comes to know how large the sender's table will be"),
        "Domain": Act(Performative.INFORM, "the receiver comes to know the sender's values"),
        "Explored": Act(Performative.INFORM, "what was proposed with `CPAs` has been seen to the end"),
        "FBCPA": Act(Performative.QUERY_REF, "the sender asks which costs the receiver adds to the CPA"),
        "FBEstimate": Act(Performative.INFORM, "the answer to `FBCPA`"),
        "FcCPA": Act(Performative.INFORM, "a copy of the CPA, for forward checking; the receiver need not extend it"),
        "Gain": Act(Performative.INFORM, "the receiver comes to know what the sender's move would save"),
        "Go": Act(Performative.INFORM, "the receiver comes to know whether the sender gains most"),
        "NewSolution": Act(Performative.INFORM, "the receiver comes to know the best solution so far"),
        "Nogood": Act(Performative.DISCONFIRM, "the receiver takes its value to be right, and it is not"),
        "NotOk": Act(Performative.DISCONFIRM, "the receiver takes the CPA to be right, and it has no solution"),
        "Offer": Act(Performative.PROPOSE, "what both would gain by moving together"),
        "Ok": Act(Performative.INFORM, "the receiver comes to know the sender's value"),
        "Order": Act(Performative.INFORM, "the receiver comes to know the new order"),
        "Path": Act(Performative.PROPOSE, "a partial assignment, for the receiver to extend or to reject"),
        "Proceed": Act(Performative.REQUEST, "the receiver is to make its table"),
        "Q": Act(Performative.INFORM, "the receiver comes to know what each value costs elsewhere"),
        "R": Act(Performative.INFORM, "the receiver comes to know what each of its values costs"),
        "Reject": Act(Performative.REJECT_PROPOSAL, "the offer that was proposed is not taken"),
        "Solution": Act(Performative.INFORM, "the receiver comes to know a solution that costs less"),
        "Solved": Act(Performative.INFORM, "the receiver comes to know the solution"),
        "Terminate": Act(Performative.CANCEL, "nobody is to search any more"),
        "Threshold": Act(Performative.REQUEST, "the receiver is to keep its value while it costs no more"),
        "Token": Act(Performative.REQUEST, "the receiver is to go on with the tree"),
        "UTIL": Act(Performative.INFORM, "the receiver comes to know what the sender's subtree costs"),
        "VALUE": Act(Performative.INFORM, "the receiver comes to know the values above it"),
        "Value": Act(Performative.INFORM, "the receiver comes to know the sender's value"),
        "Wave": Act(Performative.PROPOSE, "a candidate for the root, for the receiver to prefer or to drop"),
    }
)
"""By the name of the type. Types of one name do the same in all of our protocols."""

OTHERWISE = Act(Performative.INFORM, "every message tells the receiver something")
"""For the types of protocols that are not ours."""


def act_of(kind: str) -> Act:
    """What is done by a message of the type called `kind`."""
    return ACTS.get(kind, OTHERWISE)
