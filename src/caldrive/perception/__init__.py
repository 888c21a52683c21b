"""Image to affordances: the network, its training, and how it runs at the wheel."""
