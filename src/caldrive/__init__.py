"""caldrive: Conditional Affordance Learning for urban driving."""

__version__ = "0.1.0"
