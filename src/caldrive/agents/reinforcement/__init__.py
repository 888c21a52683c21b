"""Reinforcement learning at the wheel: a policy that learnt by trial and error. Its training is `gym.learning`."""
