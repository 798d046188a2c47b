"""How teams, models, outcomes and scenes show themselves in notebooks: HTML that needs nothing else."""
