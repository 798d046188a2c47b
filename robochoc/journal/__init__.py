"""Events of a run and the journal that keeps them: what happened, from which everything else is computed."""
