"""Recorded frames as training data: windows, sampling and augmentation."""
