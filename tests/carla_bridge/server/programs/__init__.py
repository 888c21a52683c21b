"""Programs for CARLA's client, each a process of its own: `python -m ... PORT`."""
