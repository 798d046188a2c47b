"""Measures the privacy loss of the robots in a run, from the received messages in its journal."""

from robochoc.privacy.coalitions import CoalitionLoss, CoalitionReport, coalition_report
from robochoc.privacy.errors import PrivacyError
from robochoc.privacy.losses import Kind, Loss, Measure, PrivacyReport
from robochoc.privacy.measure import coalitions_of, privacy_of

__all__ = [
    "CoalitionLoss",
    "CoalitionReport",
    "Kind",
    "Loss",
    "Measure",
    "PrivacyError",
    "PrivacyReport",
    "coalition_report",
    "coalitions_of",
    "privacy_of",
]
