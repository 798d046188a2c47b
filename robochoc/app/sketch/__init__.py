"""What a user has drawn: a sketch of a team, how it is edited, and what is made of it. No web framework in here."""
