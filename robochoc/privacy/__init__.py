"""Measures the privacy loss of robots in a run, from a journal of the messages that each has received."""

from robochoc.privacy.losses import Kind, Loss, Measure, PrivacyReport
from robochoc.privacy.measure import PrivacyError, privacy_of

__all__ = ["Kind", "Loss", "Measure", "PrivacyError", "PrivacyReport", "privacy_of"]
