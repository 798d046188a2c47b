"""The communicative acts of FIPA00037, and the acts shared by messages of several protocols."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class Performative(StrEnum):
    """The name of a communicative act, written in capitals; case is ignored when it is read."""

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
    """The communicative act of a message type: its performative, and why this performative fits."""

    performative: Performative
    why: str


INFORM = Act(Performative.INFORM, "every message informs the receiver")
"""The act of a message whose class declares no act."""

TELL_VALUE = Act(Performative.INFORM, "the receiver learns the sender's value")
TELL_DOMAIN = Act(Performative.INFORM, "the receiver learns the sender's values")
TELL_ORDER = Act(Performative.INFORM, "the receiver learns the new order")
TELL_BOUNDS = Act(Performative.INFORM, "the receiver learns bounds on the cost of a subtree")
ADD_LINK = Act(Performative.SUBSCRIBE, "the sender wants to receive the receiver's value from now on")
RULE_OUT = Act(Performative.DISCONFIRM, "the receiver assumes that its value is possible, and it is not")
PROPOSE_CPA = Act(Performative.PROPOSE, "a partial assignment, for the receiver to extend or to reject")
REJECT_VALUE = Act(Performative.REJECT_PROPOSAL, "the receiver's value, proposed with the CPA or path, is rejected")
ACCEPT = Act(Performative.ACCEPT_PROPOSAL, "the partial assignment, or the offer, that was proposed is accepted")
TERMINATE = Act(Performative.CANCEL, "all robots must stop searching")
