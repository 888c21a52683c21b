"""The trained network at the wheel."""
