"""What messages prove, worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import msgspec
import pytest

from robochoc.journal.events import Sent
from robochoc.journal.journal import Header, Journal, JournalRecorder, read_journal
from robochoc.model.assembly import Extras, assemble
from robochoc.model.problem import (
    Child,
    Constraint,
    ConstraintModel,
    Domain,
    Parent,
    ProblemKind,
    Relation,
    Semantics,
    Team,
    Variable,
)
from robochoc.privacy import Kind, Loss, Measure, PrivacyError, PrivacyReport, privacy_of
from robochoc.privacy.page import page_of
from robochoc.protocols.satisfaction.abt_messages import Ok
from robochoc.run import Options, Runtime, solve
from tests.support.cost_problems import random_cost_team, with_costs
from tests.support.problems import team_of


def soft(first: str, second: str, rows: dict[tuple[int, int], float]) -> Constraint:
    """A constraint with these costs, 0 for all other pairs."""
    relation = Relation(f"{first}{second}", 2, Semantics.SOFT, tuple(rows), tuple(rows.values()))
    return Constraint("c", relation, (first, second), (first, second))


def unary(variable: str, costs: dict[int, float]) -> Constraint:
    """A private constraint with these costs."""
    relation = Relation(f"u{variable}", 1, Semantics.SOFT, tuple((value,) for value in costs), tuple(costs.values()))
    return Constraint("u", relation, (variable,), (variable,), model=None)


def differ(first: str, second: str, model: ConstraintModel = ConstraintModel.TKC) -> Constraint:
    relation = Relation("differ", 2, Semantics.CONFLICTS, ((1, 1), (2, 2)))
    return Constraint("c", relation, (first, second), (first, second), model)


def report_of(team: Team, protocol: str) -> PrivacyReport:
    return privacy_of(journal_of(team, protocol))


def journal_of(team: Team, protocol: str, seed: int = 0) -> Journal:
    recorder = JournalRecorder(Header(team=team.name, protocol=protocol, runtime="simulator", seed=seed))
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, seed=seed, cache=False)
    recorder.outcome = solve(team, options, observer=recorder)
    return read_journal(recorder.content())


def loss(report: PrivacyReport, observer: str, subject: str, kind: Kind) -> Loss:
    (found,) = [one for one in report.losses if (one.observer, one.subject, one.kind) == (observer, subject, kind)]
    return found


PAIR = team_of({"A": (1, 2), "B": (1, 2)}, [differ("A", "B")])
CHAIN = team_of({"A": (1, 2), "B": (1, 2), "C": (1, 2)}, [differ("A", "B"), differ("B", "C")])


def test_abt_tells_lower_neighbours_the_value_and_that_it_can_be_taken() -> None:
    report = report_of(PAIR, "abt")
    assert loss(report, "RB", "RA", Kind.DECISION).entropy == 1
    assert loss(report, "RB", "RA", Kind.DOMAIN).known == 0.5  # the other value was never told
    assert loss(report, "RA", "RB", Kind.DECISION).entropy == 0
    assert loss(report, "RA", "RB", Kind.DOMAIN).entropy == 0


def test_whoever_hears_nothing_excludes_nothing() -> None:
    report = report_of(CHAIN, "abt")
    assert all(one.entropy == 0 for one in report.losses if (one.observer, one.subject) == ("RA", "RC"))
    assert loss(report, "RA", "RC", Kind.CONSTRAINTS).secrets == 4


def test_the_partial_assignment_of_sbt_tells_that_pairs_are_allowed() -> None:
    report = report_of(CHAIN, "sbt")
    # C hears of A = 1, B = 2: one of four entries, and both decisions.
    assert loss(report, "RC", "RA", Kind.CONSTRAINTS).known == 0.25
    assert [loss(report, "RC", other, Kind.DECISION).linear for other in ("RA", "RB")] == [1, 1]


def test_disfc_tells_the_value_to_whoever_knows_the_constraint() -> None:
    report = report_of(PAIR, "disfc")
    assert loss(report, "RB", "RA", Kind.DECISION).entropy == 1


def test_a_table_of_dpop_bounds_what_the_sender_pays() -> None:
    team = with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [soft("A", "B", {(1, 1): 2}), unary("B", {1: 3, 2: 3})]))
    report = report_of(team, "dpop")
    # RA is the root, as it is higher, and hears of 3 and 3. So neither value of B costs less than 3, the largest cost;
    # and with A = 1, where B = 1 costs 2 more, it is B = 2 that costs 3: two states are left of 5 x 5.
    assert loss(report, "RA", "RB", Kind.DOMAIN).linear == pytest.approx((25 - 2) / 24)
    assert loss(report, "RB", "RA", Kind.DECISION).entropy == 1


def test_the_path_of_syncbb_tells_each_robot_s_cost_exactly() -> None:
    team = with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [soft("A", "B", {(1, 1): 9}), unary("A", {1: 4, 2: 1})]))
    report = report_of(team, "syncbb")
    assert loss(report, "RB", "RA", Kind.DOMAIN).known == 1  # each value was on a path, with its cost
    assert loss(report, "RB", "RA", Kind.DECISION).known == 1


PRICED = with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [soft("A", "B", {(1, 1): 9}), unary("B", {1: 4, 2: 1})]))
"""B = 2 costs 1 whatever A is, B = 1 costs 13 or 4."""


def test_the_cpa_of_afb_tells_what_it_costs_and_a_solution_decides() -> None:
    report = report_of(PRICED, "afb")
    # RA hears of the solution A = 1, B = 2, which costs 1, and that nothing costs less.
    assert loss(report, "RA", "RB", Kind.DECISION).known == 1
    assert loss(report, "RA", "RB", Kind.DOMAIN).known == 0.5
    assert loss(report, "RB", "RA", Kind.DECISION).known == 0  # it ends the search itself, and hears of no end


@pytest.mark.parametrize("protocol", ["ncbb", "pt-fb"])
def test_a_leaf_of_ncbb_and_pt_fb_tells_what_its_value_costs(protocol: str) -> None:
    report = report_of(PRICED, protocol)
    assert loss(report, "RA", "RB", Kind.DOMAIN).known == 0.5
    assert loss(report, "RA", "RB", Kind.DECISION).known == 1  # the robot above decides on it
    assert loss(report, "RB", "RA", Kind.DECISION).known == 0  # nobody is told the final value of one above


def test_the_last_robot_of_afb_hears_that_its_last_solution_is_taken() -> None:
    team = random_cost_team(Random(0))
    journal = journal_of(team, "afb")
    last = team.order[-1]
    assert any(isinstance(one, Sent) and (one.type, one.receiver) == ("Terminate", last) for one in journal.events)
    decided = [one for one in privacy_of(journal).losses if (one.observer, one.kind) == (last, Kind.DECISION)]
    assert {one.known for one in decided} == {1}


def test_an_offer_of_mgm2_tells_what_values_cost_at_least_where_no_other_robot_has_a_part_in_it() -> None:
    alone = loss(report_of(PRICED, "mgm2"), "RA", "RB", Kind.DOMAIN)
    more = with_costs(team_of({"A": (1, 2), "B": (1, 2), "C": (1, 2)}, [*PRICED.constraints(), differ("B", "C")]))
    told = loss(report_of(more, "mgm2"), "RA", "RB", Kind.DOMAIN)
    # Of 11 x 11 states, that both values can be taken leaves 10 x 10.
    assert told.linear == pytest.approx(21 / 120)
    assert alone.linear is not None
    assert alone.linear > 21 / 120


def test_dba_tells_whether_values_go_with_each_other() -> None:
    report = report_of(PAIR, "dba")
    # RB has been at one of its two values only.
    assert loss(report, "RA", "RB", Kind.DOMAIN).known == 0.5


def test_an_answer_of_cocoa_tells_what_values_cost_at_least_where_no_other_robot_has_a_part_in_it() -> None:
    found = loss(report_of(PRICED, "cocoa"), "RA", "RB", Kind.DOMAIN)
    # RB says that both values of RA cost it 1 at least: of 0 to 9, and infinity, 0 is left to no value.
    assert found.linear is not None
    assert found.linear >= 1 - (10 * 10 - 1) / (11 * 11 - 1)


def test_a_region_of_kopt_tells_exactly_what_values_and_pairs_cost() -> None:
    more = with_costs(team_of({"A": (1, 2), "B": (1, 2), "C": (1, 2)}, [*PRICED.constraints(), differ("B", "C")]))
    report = report_of(more, "kopt")
    assert loss(report, "RA", "RB", Kind.DOMAIN).known == 1
    assert loss(report, "RC", "RB", Kind.DOMAIN).known == 1
    # The constraint of RA and RB is RA's, and RA has heard no values of RC.
    assert loss(report, "RC", "RA", Kind.DOMAIN).known == 0


def test_tables_of_count_dpop_and_mo_dpop_prove_what_those_of_dpop_do_and_goods_of_o_dpop_no_more() -> None:
    dpop, counted, vectors, opened = (
        loss(report_of(PRICED, name), "RA", "RB", Kind.DOMAIN).linear or 0
        for name in ("dpop", "count-dpop", "mo-dpop", "o-dpop")
    )
    assert dpop == counted == vectors
    assert 0 < opened <= dpop


def test_compapo_tells_values_and_a_mediator_knows_those_that_it_gives() -> None:
    team = team_of({"A": (1,), "B": (1, 2), "C": (1, 2, 3)}, [differ("A", "B"), differ("B", "C"), differ("A", "C")])
    decided = [one.known for one in report_of(team, "compapo").losses if one.kind is Kind.DECISION]
    assert set(decided) == {1}


def test_the_sides_of_acls_tell_parts_exactly() -> None:
    parts = {"RA": [soft("A", "B", {(1, 1): 3, (1, 2): 1})], "RB": [soft("A", "B", {(2, 1): 5, (1, 2): 2})]}
    own = {f"R{name}": [Variable(name, Domain("D", (range(1, 3),)))] for name in "AB"}
    report = report_of(assemble("pair", own, [], kind=ProblemKind.DISWCSP, extras=Extras(parts=parts)), "acls")
    told = [one for one in report.losses if one.kind is Kind.CONSTRAINTS]
    assert {one.secrets for one in told} == {4}
    assert max(one.known or 0 for one in told) >= 0.25


def test_a_message_without_a_rule_makes_the_loss_not_known_and_not_0(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(Ok, "proves")
    report = report_of(PAIR, "abt")
    assert report.without_rule == ("Ok",)
    heard = [one for one in report.losses if one.observer == "RB"]
    assert {one.by(measure) for one in heard for measure in Measure} == {None}
    assert report.system_loss(Kind.DOMAIN, Measure.ENTROPY) is None
    assert "not known" in page_of(report, Measure.LINEAR)


def test_what_parts_of_partially_known_constraints_say_is_a_secret_of_their_holders() -> None:
    part = differ("A", "B", ConstraintModel.PKC)
    report = report_of(team_of({"A": (1, 2), "B": (1, 2)}, [part]), "abt")
    assert {one.subject for one in report.losses if one.kind is Kind.CONSTRAINTS} <= {"RA", "RB"}
    assert any(one.kind is Kind.CONSTRAINTS for one in report.losses)


def test_a_run_that_is_not_there_is_refused() -> None:
    with pytest.raises(PrivacyError, match="no run 2, only 1"):
        privacy_of(journal_of(PAIR, "abt"), number=2)


def test_without_a_solution_nobody_decides() -> None:
    team = team_of({"A": (1,), "B": (1,)}, [differ("A", "B")])
    assert report_of(team, "abt").undecided == "the run found no solution"


def test_an_altered_message_is_found_where_it_excludes_the_truth() -> None:
    journal = journal_of(CHAIN, "abt")
    events = [
        msgspec.structs.replace(one, content={"value": [2]}) if isinstance(one, Sent) and one.sender == "RA" else one
        for one in journal.events
    ]
    altered = replace(journal, events=tuple(events))
    with pytest.raises(PrivacyError, match="exclude the true decision"):
        privacy_of(altered)


def test_the_page_has_a_cell_for_each_pair_and_needs_nothing_else() -> None:
    page = page_of(report_of(CHAIN, "sbt"), Measure.ENTROPY)
    assert page.count("<svg") == 4  # the colours, and three kinds of secrets
    assert "RC of RA: 1.000" in page
    assert "<script" not in page


@pytest.mark.parametrize("protocol", ["mgm", "gdba"])
def test_values_tell_that_they_can_be_taken_and_gains_nothing(protocol: str) -> None:
    found = loss(report_of(PRICED, protocol), "RA", "RB", Kind.DOMAIN)
    assert found.linear in (pytest.approx(11 / 120), pytest.approx(21 / 120))  # one value was taken, or both


def test_a_link_without_a_constraint_is_a_link_for_protocols() -> None:
    team = team_of({"A": (1, 2), "B": (1, 2), "C": (1, 2)}, [differ("A", "B")])
    robots = (
        replace(team["RA"], children=(*team["RA"].children, Child("RC", ("A",), ()))),
        team["RB"],
        replace(team["RC"], parents=(Parent("RA", ()),)),
    )
    report = report_of(replace(team, robots=robots), "p-dpop")
    assert loss(report, "RA", "RB", Kind.DOMAIN).entropy is not None
