"""The page "Play": a person plays one robot of the team."""
