"""FIPA acts shared by messages of several protocols; other messages declare their own."""

from __future__ import annotations

from robochoc.model.communicative_acts import Act, Performative

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
