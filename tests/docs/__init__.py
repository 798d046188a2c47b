"""Tests of the documentation: its commands and code, its links, its site."""
