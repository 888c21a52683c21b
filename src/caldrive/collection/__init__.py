"""Recordings of what the oracle drives, for training."""
