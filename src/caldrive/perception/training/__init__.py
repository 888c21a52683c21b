"""The training run: its stages, its settings, and how it resumes."""
