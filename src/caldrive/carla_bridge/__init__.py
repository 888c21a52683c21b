"""The bridge to CARLA: its client drives in the embedded world."""
