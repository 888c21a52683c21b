"""Affordances to control: the laws, their constants and presets."""
