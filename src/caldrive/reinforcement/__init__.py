"""How a policy learns in the environments of `gym`: PPO of stable-baselines3, in place of the paper's A3C."""
