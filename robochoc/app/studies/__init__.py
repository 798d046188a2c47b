"""Studies: compare protocols on a team, or on a similar family of problems, in a separate process."""
