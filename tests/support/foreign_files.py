"""Files of other programs' formats that have all kinds of their parts."""

FRODO = """<instance><presentation name="p" maximize="true" format="XCSP 2.1_FRODO"/>
<agents nbAgents="2"><agent name="a"/><agent name="S 2"/></agents>
<domains><domain name="d" nbValues="3">1..3</domain></domains>
<variables><variable name="xa" domain="d" agent="a"/><variable name="x#b" domain="d" agent="S 2"/>
<variable name="z" domain="d"/></variables>
<relations><relation name="r" arity="2" semantics="soft" defaultCost="-infinity">0.5: 1 2|2 1| -3: 3 3</relation>
<relation name="s" arity="1" nbTuples="2" semantics="supports">1|2</relation></relations>
<predicates><predicate name="p"><parameters> int X int Y </parameters><expression>
<functional> or(false, ne(X, Y)) </functional></expression></predicate></predicates>
<functions><function name="f" return="int"><parameters>int A int B int C</parameters>
<expression><functional>if(gt(A,B),mul(A,C),neg(B))</functional></expression></function></functions>
<constraints initialCost="2">
<constraint name="c1" arity="2" scope="xa x#b" reference="r" agent="a"/>
<constraint name="c2" arity="1" scope="z" reference="s"/>
<constraint name="c3" arity="2" scope="xa x#b" reference="p"><parameters>xa x#b</parameters></constraint>
<constraint name="c4" arity="2" scope="xa z" reference="f"><parameters>xa z -2</parameters></constraint>
<constraint name="c5" scope="xa x#b z" reference="global:allDifferent">
<parameters>[ xa x#b z ]</parameters></constraint>
<constraint name="c6" scope="xa x#b z" reference="global:weightedSum">
<parameters>[ { 1 xa } { -2 x#b } { 3 z } ] <le/> 4</parameters></constraint>
<constraint name="c7" scope="xa x#b" reference="global:element"><parameters>xa [ 1 x#b 3 ] 2</parameters></constraint>
<constraint name="c8" scope="xa x#b" reference="global:cumulative">
<parameters>[ { xa 1 <nil/> 1 } { x#b 2 <nil/> 1 } ] <le/> 1</parameters></constraint>
</constraints></instance>"""

XDISCSP = """<instance><presentation name="i" type="{kind}" model="Complex" constraintModel="{model}"
format="XDisCSP 1.0"/>
<agents nbAgents="2"><agent name="A1" id="1" description="first"/><agent name="A2" id="2"/></agents>
<domains nbDomains="1"><domain name="D1" nbValues="2">1..2</domain></domains>
<variables nbVariables="2"><variable agent="A1" name="X1.1" id="1" domain="D1"/>
<variable agent="A2" name="X2.1" id="1" domain="D1"/></variables>
<constraints nbConstraints="1" initialCost="1" maximalCost="90">
<constraint name="C" model="{model}" arity="2" scope="X1.1 X2.1" reference="R0" ownerId="1"/></constraints>
<relations nbRelations="1">{relation}</relations></instance>"""
_SOFT = '<relation name="R0" semantics="soft" defaultCost="infinity">7:1 1|4:1 2|5:2 1|6:2 2</relation>'
_HARD = '<relation name="R0" arity="2" semantics="conflicts">1 1|2 2</relation>'
_BOTH = '<relation name="R0" semantics="soft" defaultCost="0">7 1:1 1|4 2:1 2</relation>'
XDISCSPS = (
    XDISCSP.format(kind="DCOP", model="TKC", relation=_SOFT),
    XDISCSP.format(kind="MaxDisCSP", model="TKC", relation=_HARD),
    XDISCSP.format(kind="DisCSP", model="PKC", relation=_HARD),
    XDISCSP.format(kind="ADCOP", model="TKC", relation=_BOTH),
)

CFN = """# loose
{ problem: { name: "loose" mustbe: "<20.00" }
  variables: { x: [a b] "y": 3, z: -2 }  // three
  functions: {
    c: {scope: [], costs: [-1.50]}
    {scope [x y] defaultcost: 1.259 costs: [a 0 2, b 2 inf, 1 1 -3.1]}
    t1: {scope: [x z], costs: t2}
    t2: {scope: [x 2], costs: [0 1 2 3]}
} }
"""
WCSP = "shared 3 2 4 5\n2 2 2\n-2 0 1 0 2\n0 0 1\n1 1 9\n2 1 2 0 -1\n1 2 0 1\n1 2\n0 3 0\n"
