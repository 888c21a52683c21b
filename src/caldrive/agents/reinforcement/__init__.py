"""A policy at the wheel that learnt by trial and error; how it learnt is `caldrive.reinforcement`."""
