"""A server that speaks CARLA 0.9.16's protocol, in front of the embedded world."""
