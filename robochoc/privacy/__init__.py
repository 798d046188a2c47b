"""Measures the privacy loss of the robots in a run, from the received messages in its journal."""

from robochoc.privacy.losses import Kind, Loss, Measure, PrivacyReport
from robochoc.privacy.measure import PrivacyError, privacy_of

__all__ = ["Kind", "Loss", "Measure", "PrivacyError", "PrivacyReport", "privacy_of"]
