"""Who drives: the CAL agent, the oracle, and the registry of all agents."""
