"""Builds the outputs of an ended run: flight, conversation, recording, report, saved state."""
