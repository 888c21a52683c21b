"""Pictures for people: videos, plans, plots and sheets."""
