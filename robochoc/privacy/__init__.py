"""How much robots learn of each other's problems in a run, from a journal of what each has heard."""

from robochoc.privacy.losses import Kind, Loss, Measure, PrivacyReport
from robochoc.privacy.measure import PrivacyError, privacy_of

__all__ = ["Kind", "Loss", "Measure", "PrivacyError", "PrivacyReport", "privacy_of"]
