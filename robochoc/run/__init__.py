"""A team goes in, an outcome comes out: everything that solves goes through here."""
