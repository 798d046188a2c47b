"""The benchmark set: the published list has the digests and optima of the generated instances."""

from __future__ import annotations

from importlib.resources import files

import pytest

from robochoc.experiments.digests import sha256_of_team
from robochoc.leaderboard import certificates
from robochoc.leaderboard.certificates import (
    BEST_KNOWN,
    DisputedInstanceError,
    certify,
    list_content,
    published,
)
from robochoc.leaderboard.instances import (
    FAMILIES,
    SEEDS,
    SIZES,
    UnknownInstanceError,
    instance_named,
    instances,
)
from robochoc.leaderboard.tables import answer_text, proof_text
from robochoc.verification.checker import check_user_cost, violations
from tests.support.cases import looped

ONE_OF_EACH = [f"{name}-{SIZES[0]}-0" for name in FAMILIES]


def test_the_list_has_each_instance_once() -> None:
    named = [one.name for one in instances()]
    assert list(published()) == named
    assert len(named) == sum(len(SIZES) * (SEEDS if family.has_seeds else 1) for family in FAMILIES.values())
    for one in instances():
        found, problem = published()[one.name], one.problem
        assert (found.family, found.size, found.generator) == (one.family, one.size, problem.family)
        assert (found.parameters, found.scenario) == (problem.parameters, problem.scenario)


@looped("name", ONE_OF_EACH)
def test_one_instance_of_each_family_has_its_digest(name: str) -> None:
    team = instance_named(name).team()
    assert (sha256_of_team(team), len(team.robots)) == (published()[name].sha256, published()[name].robots)


@pytest.mark.slow
def test_all_instances_have_their_digests() -> None:
    for one in instances():
        assert sha256_of_team(one.team()) == published()[one.name].sha256, one.name


def test_each_optimum_has_two_proofs() -> None:
    for one in published().values():
        assert one.proved_by != one.agreed_by
        assert one.verdict in {"optimal", "solution", "no-solution", BEST_KNOWN}
        assert (one.cost is not None) == (one.verdict in {"optimal", BEST_KNOWN})
        assert one.bound == one.cost or one.verdict == BEST_KNOWN
        assert bool(one.agreed_by) == (one.verdict != BEST_KNOWN) == (not one.assignment) == (not one.found_by)


def test_the_assignments_of_best_known_answers_have_their_costs() -> None:
    best_known = [one for one in published().values() if one.verdict == BEST_KNOWN]
    assert {one.family for one in best_known} == {"random"}
    for one in best_known:
        team = instance_named(one.name).team()
        assert list(violations(team, one.assignment)) == []
        check_user_cost(team, one.assignment, one.cost)


def test_no_solver_confirms_a_best_known_answer() -> None:
    one = published()["random-medium-0"]
    assert answer_text(one) == f"best known {one.cost}, bound {one.bound}"
    assert proof_text(one) == (
        "toulbar2 found the assignment, whose cost robochoc's checker has computed. toulbar2 proved the bound, which no"
        " second solver has confirmed."
    )


@looped("name", ["random-small-0", "coloring-hard-small-1", "tasks-small-2", "random-medium-0"])
def test_a_certificate_is_computed_again(name: str) -> None:
    assert certify(instance_named(name)) == published()[name]


@pytest.mark.slow
@looped("name", ONE_OF_EACH)
def test_one_certificate_of_each_family_is_computed_again(name: str) -> None:
    assert certify(instance_named(name)) == published()[name]


def test_the_written_list_is_the_published_one() -> None:
    file = files(certificates.__package__).joinpath(certificates.LIST_FILE)
    assert list_content(published().values()) == file.read_bytes()


def test_solvers_that_disagree_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter([("optimal", 3), ("optimal", 4), ("unknown", None)])
    monkeypatch.setattr(certificates, "_outcome", lambda *_: None)
    monkeypatch.setattr(certificates, "answer_of", lambda _: next(answers))
    with pytest.raises(DisputedInstanceError, match="random-small-0: toulbar2 answers optimal 3, but dpop"):
        certify(instance_named("random-small-0"))
    with pytest.raises(DisputedInstanceError, match="random-medium-0: toulbar2 proved nothing within 600 s"):
        certify(instance_named("random-medium-0"))


def test_unknown_names_are_refused() -> None:
    with pytest.raises(UnknownInstanceError, match="did you mean 'random'"):
        list(instances(["rndom"]))
    with pytest.raises(UnknownInstanceError, match="no size 'huge'"):
        list(instances(sizes=["huge"]))
    with pytest.raises(UnknownInstanceError, match="no instance 'random-small-99'"):
        instance_named("random-small-99")
