"""The application: `robochoc app`, where people model a team by hand, let it decide, and see it fly, in a browser."""
