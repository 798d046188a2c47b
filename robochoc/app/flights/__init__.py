"""Builds the outputs of a finished run: flight, conversation, recording, report, saved state."""
