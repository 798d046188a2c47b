"""The loop of deciding and observing: decisions go to sinks, and reports from sources change the problem."""
