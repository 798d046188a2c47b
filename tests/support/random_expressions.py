"""Random expressions with all operators, as strategies of Hypothesis."""

from __future__ import annotations

from hypothesis import strategies as st

from robochoc.model.expression import Apply, Constant, Expression, Name

NAMES = ("X", "Y", "i", "V3.1")


def terms(inner: st.SearchStrategy[Expression], truths: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    """Integer expressions over smaller ones."""
    two = st.tuples(inner, inner)
    more = st.lists(inner, min_size=2, max_size=4).map(tuple)
    return st.one_of(
        st.builds(Apply, st.sampled_from(["neg", "abs", "sqr"]), st.tuples(inner)),
        st.builds(Apply, st.sampled_from(["sub", "div", "mod", "pow", "dist"]), two),
        st.builds(Apply, st.sampled_from(["add", "mul", "min", "max"]), more),
        st.builds(Apply, st.just("if"), st.tuples(truths, inner, inner)),
    )


def truths(
    inner: st.SearchStrategy[Expression], numbers: st.SearchStrategy[Expression]
) -> st.SearchStrategy[Expression]:
    """Boolean expressions over smaller ones."""
    more = st.lists(inner, min_size=2, max_size=4).map(tuple)
    return st.one_of(
        comparisons(numbers),
        st.builds(Apply, st.just("not"), st.tuples(inner)),
        st.builds(Apply, st.just("imp"), st.tuples(inner, inner)),
        st.builds(Apply, st.sampled_from(["and", "or", "xor", "iff"]), more),
    )


def comparisons(numbers: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    more = st.lists(numbers, min_size=2, max_size=4).map(tuple)
    return st.one_of(
        st.builds(Apply, st.sampled_from(["eq", "ne", "lt", "le", "gt", "ge"]), st.tuples(numbers, numbers)),
        st.builds(Apply, st.sampled_from(["eq", "in"]), more),
    )


def small_or_huge() -> st.SearchStrategy[int]:
    return st.one_of(st.integers(-4, 4), st.integers(-70, 70), st.integers(-(10**18) + 1, 10**18 - 1))


LEAVES: st.SearchStrategy[Expression] = st.one_of(
    st.builds(Constant, small_or_huge()), st.builds(Name, st.sampled_from(NAMES))
)
NUMBERS = st.recursive(LEAVES, lambda inner: terms(inner, comparisons(inner)), max_leaves=12)
TRUTHS = st.recursive(comparisons(NUMBERS), lambda inner: truths(inner, NUMBERS), max_leaves=6)
