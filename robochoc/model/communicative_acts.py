"""The communicative acts of FIPA00037: what a robot does by saying a message."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class Performative(StrEnum):
    """The name of a communicative act. Written in capitals, and read in any case."""

    ACCEPT_PROPOSAL = "accept-proposal"
    AGREE = "agree"
    CANCEL = "cancel"
    CFP = "cfp"
    CONFIRM = "confirm"
    DISCONFIRM = "disconfirm"
    FAILURE = "failure"
    INFORM = "inform"
    INFORM_IF = "inform-if"
    INFORM_REF = "inform-ref"
    NOT_UNDERSTOOD = "not-understood"
    PROPAGATE = "propagate"
    PROPOSE = "propose"
    PROXY = "proxy"
    QUERY_IF = "query-if"
    QUERY_REF = "query-ref"
    REFUSE = "refuse"
    REJECT_PROPOSAL = "reject-proposal"
    REQUEST = "request"
    REQUEST_WHEN = "request-when"
    REQUEST_WHENEVER = "request-whenever"
    SUBSCRIBE = "subscribe"


class Act(NamedTuple):
    """The act of a type of message: its performative, and the reason for it."""

    performative: Performative
    why: str


INFORM = Act(Performative.INFORM, "every message tells the receiver something")
"""The act of a message whose class declares no other."""
