"""The Authority unit: enrolment, identities (certificates), and the rights of each name."""
