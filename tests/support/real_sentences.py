"""Sentences of runs that messages of the protocols say, by protocol and message type."""

from __future__ import annotations

REAL = {
    ("ssi", "Bid"): "Robot4 says: I bid 92 for the next task that I want",
    ("ssi", "Won"): "Robot4 says: task V4 = 4 is mine, and I bid for nothing more",
    ("grape", "Partition"): ("Robot2 says: after move 1, which was Robot2's, Robot2 does task V2 = 1"),
    ("cbaa", "WinningBids"): "Robot1 says: task V1 = 1 is Robot2's for 24 and task V1 = 2 is mine for 44",
    ("cbba", "Bundles"): (
        "Robot1 says: task V1 = 1 is Robot2's for 24, task V1 = 2 is mine for 44 and task V1 = 4 is Robot4's for 92"
    ),
    ("aas", "Ok"): "Robot1.1 says: V1.1 is 1, 2 or 3 from now on",
    ("aas", "Nogood"): "Robot2.1 says: as long as V1.1 is 1, it cannot be that V1.2 is 3",
    ("aas", "Narrow"): "Robot1.2 says: please keep to this: V1.1 is 1",
    ("abt", "Ok"): "Robot1.1 says: V1.1 = 1 from now on",
    ("abt", "Nogood"): "Robot3.2 says: as long as V1.2 = 1, V3.1 cannot be 2",
    ("abt", "AddLink"): "Robot3.1 says: tell me V1.2 from now on",
    ("dynabt", "Nogood"): "Robot3.2 says: as long as V1.2 = 1, V3.1 cannot be 2",
    ("abt-do-retro", "Ok"): "Robot1.1 says: V1.1 = 3 from now on; 1 of my values is not ruled out",
    ("abt-do-retro", "Nogood"): (
        "Robot2.3 says: as long as V1.2 = 1, V1.3 cannot be 2; without that value, 2 of my values are not ruled out"
    ),
    ("abt-do-retro", "Order"): (
        "Robot1.2 says: the order is now Robot1.1, Robot2.1, Robot1.2, Robot1.3, Robot2.2, Robot2.3, Robot3.1,"
        " Robot3.2 and Robot3.3"
    ),
    ("abt-do-retro", "AddLink"): "Robot3.1 says: tell me V1.2 from now on, whenever you are above me",
    ("agile-abt", "Ok"): (
        "Robot3.3 says: V3.3 = 2 from now on; as long as V1.1 = 1 and V1.3 = 1, I have 1 of 3 values left"
    ),
    ("agile-abt", "Nogood"): "Robot3.1 says: as long as V1.1 = 1, V2.1 cannot be 3",
    ("agile-abt", "Order"): (
        "Robot3.3 says: the order is now Robot1.1, Robot1.3, Robot3.3, Robot2.3, Robot2.2, Robot3.1, Robot3.2,"
        " Robot1.2 and Robot2.1"
    ),
    ("compapo", "Init"): "Robot1.1 says: V1.1 is 1, 2 or 3",
    ("compapo", "Wait"): "Robot1.1 says: wait with your mediation: another one is going on here that comes first",
    ("awc", "Ok"): "Robot3.3 says: V3.3 = 1 from now on, with priority 3",
    ("awc", "Nogood"): "Robot1.1 says: V1.3 = 2 and V1.2 = 2 cannot both stand",
    ("awc", "AddLink"): "Robot1.1 says: from now on let us tell each other V1.1 and V2.3",
    (
        "disfc",
        "Ok",
    ): "Robot1.1 says: my assignment number 2 stands from now on; it leaves Robot1.2 0 values of its domain",
    ("disfc", "Nogood"): (
        "Robot3.3 says: as long as Robot2.3 keeps its assignment number 1, Robot3.2 cannot keep its assignment number 3"
    ),
    ("disfc", "AddLink"): "Robot3.1 says: tell me of each new assignment of yours from now on",
    ("afc", "CPA"): "Robot1.2 says: so far V1.1 = 3 and V1.2 = 1; it is Robot1.3's turn",
    ("afc", "FcCPA"): "Robot1.1 says: so far V1.1 = 1; look which of your values still go with it",
    ("afc", "NotOk"): "Robot2.2 says: no solution has V1.1 = 1 and V1.2 = 3",
    ("afc", "BacktrackCPA"): "Robot1.3 says: no solution has V1.1 = 3 and V1.2 = 1: take another value",
    ("afc-ng", "CPA"): "Robot1.2 says: so far V1.1 = 3 and V1.2 = 1",
    ("afc-ng", "Nogood"): "Robot2.1 says: V1.1 cannot be 2, whatever the others do",
    ("afc-tree", "Nogood"): "Robot2.1 says: V1.1 cannot be 2, whatever the others do",
    ("sbt", "CPA"): "Robot1.2 says: so far V1.1 = 3 and V1.2 = 1; it is Robot1.3's turn",
    ("sbt", "Backtrack"): (
        "Robot1.3 says: nobody below Robot1.2 has a value left that goes with its own: take another one"
    ),
    ("adopt", "Wave"): "RX03 says: RX00, which has 3 neighbours, wants to be the root",
    ("adopt", "Token"): "RX02 says: you are my child in the tree, where not all know of RX00, RX02 and RX01 yet",
    ("adopt", "Back"): "RX01 says: all below me are in the tree, where not all know of RX00, RX02 and RX01 yet",
    ("adopt", "Value"): "RX03 says: X03 = 3 from now on (change 30)",
    ("adopt", "Cost"): "RX03 says: as long as X02 = -3 and X00 = 5, my subtree costs between 0 and 10",
    ("adopt", "Threshold"): ("RX02 says: as long as X00 = -3, your subtree may cost 11 before you try other values"),
    ("adopt", "Terminate"): "RX02 says: all above you have taken their last values: X00 = -3 and X02 = 1",
    ("bnb-adopt", "Value"): "RX03 says: X03 = 3 from now on (change 20); your subtree may cost 3 then",
    ("bnb-adopt", "Cost"): (
        "RX03 says: as long as X02 = 1 and X00 = 3, my subtree costs between 0 and 9; tell me my threshold again"
    ),
    ("bnb-adopt-fdac", "Domain"): "RX02 says: X02 is -3, 0, 1 or 3; what can you move to each of them?",
    ("bnb-adopt-fdac", "Moved"): "RX01 says: count as your own, with your values one by one: 13, 12, 13, 12",
    ("bnb-adopt-fdac", "Value"): "RX02 says: X02 = 1 from now on (change 1)",
    ("bnb-adopt-fdac", "Cost"): (
        "RX01 says: as long as X00 = -3 and X02 = 1, my subtree costs 0 more than it has moved up"
    ),
    ("adopt-k", "Value"): (
        "RX03 says: X03 = 3 from now on (change 18); try other values once yours costs k more than 0, or 8"
    ),
    ("ncbb", "Members"): "RX03 says: in my subtree constraints are shared by RX03 with RX02 and RX04 with RX00",
    ("ncbb", "Greedy"): "RX02 says: X02 = 1 in the first assignment",
    ("ncbb", "Request"): "RX02 says: X02 = 3 for now; what will you cost at least?",
    ("ncbb", "Report"): "RX02 says: with your value and those above you, I cost at least 9",
    ("ncbb", "Search"): "RX02 says: search your subtree for less than 20",
    ("ncbb", "Result"): "RX02 says: my subtree costs 25, with X02 = 1, X01 = -1, X03 = 3 and X04 = -2",
    ("ncbb", "Terminate"): "RX02 says: the search is over, with X03 = 3 and X04 = -2",
    ("pt-fb", "CPA"): "RX02 says: search your subtree for less than 8; at least 5 of it is paid by RX04",
    ("pt-fb", "Reduce"): "RX02 says: search no further",
    ("hs-cai", "Domain"): "RX03 says: X03 is 0 or 3; my depth in the tree is 2",
    ("hs-cai", "PreUtil"): "RX02 says: my subtree costs at least 25 to 31, by the values of RX00",
    ("hs-cai", "CPA"): (
        "RX02 says: search your subtree whatever it costs, with RX00's value number 1 and RX02's value number 1"
    ),
    ("dpop", "Domain"): "RX00 says: X00 is -3, 0, 3 or 5",
    ("dpop", "Dimensions"): (
        "RX03 says: my table will have 16 cells over RX02 (4 values) and RX00 (4 values), and no cost above 19;"
        " from me down the induced width is 2, and RX03 needs the most memory, 1,128 bytes"
    ),
    ("dpop", "Proceed"): "RX03 says: all tables fit: make yours, over RX03 and RX00",
    ("dpop", "UTIL"): "RX01 says: a piece of my table: 16 costs, from 17 to 24",
    ("dpop", "VALUE"): (
        "RX03 says: by number, the values of the robots in your separator are 2 and 1, the nearest robot first"
    ),
    ("count-dpop", "CountDimensions"): (
        "RX02 says: my table will have 4 cells over RX00 (4 values), and no cost above 60; from me down the induced"
        " width is 2, and RX03 needs the most memory, 2,152 bytes; 9 bits are enough for my numbers"
    ),
    ("count-dpop", "Counts"): (
        "RX01 says: in how many ways my subtree attains the costs of my table: 16 cells, of 1 byte"
    ),
    ("p-dpop", "Wave"): "RX00 says: a robot whose score begins with 5df9 wants to be the root",
    ("p-dpop", "Token"): "RX00 says: if you are not in the tree yet, you are my child",
    ("p-dpop", "Bounce"): "RX00 says: I am in the tree, above you",
    ("p-dpop", "Back"): "RX04 says: all below me are in the tree",
    ("p-dpop", "Codes"): "RX00 says: call me 0a6a; X00 is 5, -3, 0 or 3, and you get a key for each",
    ("p-dpop", "UTIL"): "RX02 says: a table over 3 codenames: 16 costs, hidden by keys",
    ("p-dpop", "VALUE"): "RX01 says: the codes of 1 value above you",
    ("p32-dpop", "Join"): "RX00 says: take the next number in the ring, and add your key to b3db",
    ("p32-dpop", "Setup"): "RX00 says: our key begins with d517, and there are 5 turns",
    ("p32-dpop", "Vector"): "RX00 says: somebody's turns, encrypted (4860): shuffle it",
    ("p32-dpop", "Table"): "RX00 says: a table over 1 codename: 3 costs, hidden by keys, for turn 5",
    ("p32-dpop", "Next"): "RX00 says: the next turn begins",
    ("p2-dpop", "CostSum"): (
        "RX00 says: add to these two sums, which began with random numbers, how far your costs may go"
    ),
    ("p2-dpop", "CostRange"): "RX00 says: our costs add up to at least 0, and to at most 9 more",
    ("p2-dpop", "Plan"): "RX00 says: in turn 1 there will be a table over 1 codename here, with 2 cells",
    ("p2-dpop", "AskAxis"): "RX00 says: what are you called in turn 1, if you are still to come?",
    ("p2-dpop", "Axis"): "RX00 says: in turn 2 call me 66d5; as declared, X00 is -3, -1 or 3",
    ("p2-dpop", "Gone"): "RX00 says: in turn 1 I come before you",
    ("p2-dpop", "EncryptedTable"): "RX00 says: the table of turn 1, encrypted: 320 bytes",
    ("p2-dpop", "Opening"): "RX00 says: blind this cipher (02ed), and take your share of the key off",
    ("mb-dpop", "DomainAtDepth"): "RX02 says: 1 robot above me in the tree; X02 is -3, 0, 1 or 3",
    ("mb-dpop", "Label"): (
        "RX03 says: my table has 16 cells over RX02 (4 values) and RX00 (4 values), and no cost above 19"
    ),
    ("rmb-dpop", "ClusterLabel"): (
        "RX03 says: my table has 16 cells over RX02 (4 values) and RX00 (4 values), and no cost above 19"
    ),
    ("list-dpop", "ListedValues"): "RX00 says: 1 optimum, with 1 combination of values of the robots in your separator",
    ("afb", "CPA"): (
        "RX03 says: so far X00 = -3, X01 = -1, X02 = 1 and X03 = 3, which costs at least 22;"
        " the best solution so far costs 26; it is RX04's turn"
    ),
    ("afb", "FBCPA"): "RX01 says: so far X00 = 5 and X01 = -1; what does a value of yours add to it at least?",
    ("afb", "FBEstimate"): (
        "RX04 says: a value of mine adds at least 3 to a CPA of 2 values; to its beginnings, the empty one first,"
        " at least 0"
    ),
    ("afb", "NewSolution"): (
        "RX04 says: the best solution so far costs 25: X00 = -3, X01 = -1, X02 = 1, X03 = 3 and X04 = -2"
    ),
    ("afb", "Terminate"): "RX00 says: the search is over: no solution costs less than 25",
    ("syncbb", "Path"): (
        "RX01 says: so far X00 = -3 and X01 = -1, which costs 13; the best solution so far costs 26; it is RX02's turn"
    ),
    ("syncbb", "Backtrack"): ("RX01 says: RX00's value leads to nothing that costs less than 25: take another one"),
    ("syncbb", "Terminate"): (
        "RX00 says: the search is over: nothing costs less than 25, with X00 = -3, X01 = -1, X02 = 1, X03 = 3 and"
        " X04 = -2"
    ),
    ("sfb", "Above"): "RX02 says: above you there are RX00 (4 values), RX01 (2 values) and RX02 (4 values)",
    ("sfb", "Below"): (
        "RX02 says: below you there are RX02 (4 values), RX03 (2 values) and RX04 (3 values);"
        " all together they cost at most 13"
    ),
    ("sfb", "CPAs"): "RX00 says: 1 partial assignment for RX01 to extend; no solution is known yet",
    ("sfb", "Explored"): (
        "RX01 says: nothing is left of the oldest partial assignments that I have had from you and have not answered"
    ),
    ("sfb", "Solution"): (
        "RX04 says: a solution costs 25, less than all before; by number, robots' values in it are 1, 2, 3, 2 and 1"
    ),
    ("cocoa", "Inquiry"): "RX01 says: what would each of my 2 values cost you at least?; so far X00 = -3",
    ("cocoa", "Costs"): "RX01 says: of your 4 values, number 1 would cost me least: 12 of cost",
    ("cocoa", "SetValue"): "RX02 says: X02 = 1 for good",
    ("lamdls", "Colour"): "RX01 says: X01 = -3 at first, and my colour is number 2",
    ("kopt", "Region"): "RX00 says: 2 constraints of RX01, RX02 and RX04, value by value",
    ("kopt", "Values"): "RX00 says: RX00 has its value number 4",
    ("kopt", "Offers"): "RX00 says: I have heard of no move that saves anything",
    ("kopt", "MoveTogether"): "RX00 says: go: RX00",
    ("duct", "Separator"): "RX01 says: my subtree depends on RX02 and RX00, and costs 25 at most",
    ("duct", "SampleContext"): "RX02 says: sample your subtree with X02 = 1 and X00 = 0",
    ("duct", "SampleCost"): "RX02 says: this sample costs my subtree 32; the best so far costs 27",
    ("d-gibbs", "Value"): "RX00 says: X00 = -3 in this sample; the last sample was the best so far",
    ("d-gibbs", "Difference"): "RX01 says: by this sample my subtree has 1 broken constraint more and 9 of cost less",
    ("d-gibbs", "Finish"): (
        "RX00 says: the search is over: take your value of the best sample;"
        " the last sample was not better than the best"
    ),
    ("a-dsa", "Tick"): "RX00 says: X00 = -3 at present",
    ("dsa", "Value"): "RX01 says: X01 = -3 in this cycle",
    ("mgm", "Gain"): "RX00 says: my move would save 8 of cost",
    ("mgm2", "Domain"): "RX04 says: X04 is -2, -1 or 4",
    ("mgm2", "Offer"): (
        "RX04 says: let us move together: of 4 values of yours and 3 of mine, the best two would save me 3 of cost"
    ),
    ("mgm2", "Accept"): "RX04 says: I take your offer: you take your value number 1, and we save 3 of cost in all",
    ("mgm2", "Reject"): "RX04 says: I do not take your offer",
    ("mgm2", "Go"): "RX03 says: no go: one of my neighbours is to move instead",
    ("dba", "Improve"): "Robot1.1 says: what I violate weighs 10, and my move would make that 0 less",
    ("gdba", "Improve"): "RX00 says: as I weigh constraints by now, my move would save 8 of cost",
    ("maxsum", "R"): "RX02 says: by our function, RX01's values cost 5 and 5",
    ("maxsum", "Q"): "RX00 says: without our function, RX00's values cost 0, 1.005, 2 and 2.01",
}
