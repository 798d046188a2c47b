"""The loop of deciding and observing: decisions are sent to sinks, and reports from sources change the problem."""
