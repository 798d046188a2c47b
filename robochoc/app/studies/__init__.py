"""Studies: protocols are compared on a team, or on a family of problems like it, in a process of its own."""
