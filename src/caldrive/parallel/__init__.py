"""Work for several processes, on this machine or on a cluster."""
