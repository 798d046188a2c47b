"""The Authority unit: who may take part, how they prove who they are, and what each of them may do."""
