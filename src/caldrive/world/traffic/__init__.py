"""Everybody who moves: the ego, cars, people, lights, and what they touch."""
