"""Settings outside their ranges are refused, by the rule that they break."""

from __future__ import annotations

import pytest

from robochoc.protocols.settings import SettingsError, read_settings
from robochoc.run.registry import protocol_named
from tests.support.cases import looped

PART, POSITIVE_PART = "it must be from 0 to 1", "it must be more than 0 and at most 1"


@looped(("protocol", "setting", "values", "rule"), [
    ("c-cocoa", "moves", "-1 many", "moves"),
    ("dpop", "memory", "0 -1 much", "memory"),
    ("dsa", "probability", "0 1.5 nan -1", POSITIVE_PART),
    ("dsa", "variant", "F", "variant"),
    ("dsa-sdp", "pa", "1.5", PART),
    ("dsa-sdp", "pb", "0.5", "pa [+] pb is 1.1; it must be at most 1"),
    ("dsa-sdp", "pd", "-inf", PART),
    ("dsa-sdp", "period", "0", "it must be 1 or more"),
    ("duct", "bound", "-1", "it must be"),
    ("duct", "confidence", "1", "it must be"),
    ("duct", "contexts", "0", "it must be"),
    ("duct", "error", "-1", "it must be"),
    ("duct", "samples", "0", "it must be"),
    ("hs-cai", "k", "0", "1 or more"),
    ("hs-cai", "t", "0", "1 or more"),
    ("kopt", "k", "0 9", "it must be from 1 to 8"),
    ("list-dpop", "limit", "0 -1 10001", "from 1 to 10,000 optima"),
    ("maxsum", "damping", "1 -0.5 nan", "from 0 to below 1"),
    ("maxsum", "preference", "-1 inf", "a number, 0 or more"),
    ("maxsum", "split", "0.6 -0.1 nan", "from 0 .none. to 0.5 .halves."),
    ("maxsum-ad", "cycles", "0", "1 or more"),
    ("maxsum-ad", "preference", "-1", "a number, 0 or more"),
    ("maxsum-ad", "variant", "VP", "variant"),
    ("mb-dpop", "k", "0 -1", "k"),
    ("mb-dpop", "memory", "0", "memory"),
    ("mgm2", "threshold", "-0.1 1.1 nan", PART),
    ("mixed-dsa", "hard", "0 1.1 nan", POSITIVE_PART),
    ("mixed-dsa", "soft", "0 1.1 nan", POSITIVE_PART),
    ("p2-dpop", "ciphers", "0 1000001", "ciphers is .*from 1 to 1,000,000"),
    ("p2-dpop", "spare", "-1 1001", "spare is"),
    ("p32-dpop", "spare", "-1 1001", "spare is"),
    ("p-dsa", "cycles", "0 100001", "cycles is .*from 1 to 100,000"),
    ("p-dsa", "probability", "0 1.1 nan", "more than 0 and at most 1"),
    ("p-maxsum", "preference", "-1 1 nan", "preference is .*from 0 to below 1"),
    ("p-maxsum", "split", "half", "split"),
    ("p-maxsum", "topology", "closed", "topology"),
    ("pc-syncbb", "bits", "30 5 8192", "bits is .*one of 31, 61"),
    ("pc-syncbb", "comparisons", "0 10000001", "comparisons is .*from 1 to 10,000,000"),
    ("pc-syncbb", "search", "closed", "search"),
    ("pfd", "particles", "0 10001", "particles is .*from 1 to 10,000"),
    ("pfd", "w", "-1 11 nan", "w is .*from 0 to 10"),
    ("regret-matching", "cycles", "0", "it must be 1 or more"),
    ("regret-matching", "inertia", "1", "it must be 0 or more, and less than 1"),
    ("regret-matching", "variant", "RM", "'RM' is not allowed; allowed: rm, rm[+]"),
    ("regret-matching", "weight", "1.5 nan", PART),
    ("sfb", "batch", "0 many", "batch"),
    ("sfb", "memory", "0", "memory"),
    ("sfb", "window", "0", "window"),
])  # fmt: skip
def test_a_setting_outside_its_range_is_refused(protocol: str, setting: str, values: str, rule: str) -> None:
    for value in values.split():
        with pytest.raises(SettingsError, match=rule) as refused:
            read_settings(protocol_named(protocol), {setting: value})
        assert setting in str(refused.value), value
