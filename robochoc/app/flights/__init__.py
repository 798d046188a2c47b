"""Makes what is looked at and handed on after a run: the flight, the conversation, a recording, a report, its state."""
