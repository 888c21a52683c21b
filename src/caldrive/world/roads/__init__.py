"""Road networks: lanes, routes, plans and maps."""
