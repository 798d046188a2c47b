"""Options and arguments shared by several commands, and their parsing."""
