"""The embedded world: roads, traffic, truth, scene and pictures."""
