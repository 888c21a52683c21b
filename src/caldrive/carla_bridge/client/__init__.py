"""The agents drive in CARLA, through its official client."""
