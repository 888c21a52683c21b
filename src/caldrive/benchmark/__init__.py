"""Suites of episodes: driven, counted, kept, replayed and reported."""
