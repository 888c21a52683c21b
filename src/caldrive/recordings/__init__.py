"""Recorded episodes on disk: written, read, found and checked."""
