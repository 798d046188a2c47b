"""FIPA acts shared by messages of several protocols; other messages declare their own."""

from __future__ import annotations

from robochoc.model.communicative_acts import Act, Performative

TELL_VALUE = Act(Performative.INFORM, "the receiver comes to know the sender's value")
TELL_DOMAIN = Act(Performative.INFORM, "the receiver comes to know the sender's values")
TELL_ORDER = Act(Performative.INFORM, "the receiver comes to know the new order")
TELL_BOUNDS = Act(Performative.INFORM, "the receiver comes to know bounds on what a subtree costs")
ADD_LINK = Act(Performative.SUBSCRIBE, "from now on the sender wants to be told the receiver's value")
RULE_OUT = Act(Performative.DISCONFIRM, "the receiver takes its value to be right, and it is not")
PROPOSE_CPA = Act(Performative.PROPOSE, "a partial assignment, for the receiver to extend or to reject")
REJECT_VALUE = Act(Performative.REJECT_PROPOSAL, "the receiver's value, proposed with the CPA or path, will not do")
ACCEPT = Act(Performative.ACCEPT_PROPOSAL, "the partial assignment, or the offer, that was proposed is taken")
TERMINATE = Act(Performative.CANCEL, "nobody is to search any more")
