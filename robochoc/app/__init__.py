"""The application `robochoc app`: users model a team, solve its problem and watch it fly, in a browser."""
