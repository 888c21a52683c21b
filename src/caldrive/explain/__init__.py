"""Why an agent drives as it does: whom to blame for a failure, and where the network looks."""
