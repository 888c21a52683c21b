"""How well a network sees recorded frames."""
