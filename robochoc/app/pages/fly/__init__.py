"""The page "Fly" of a team."""
