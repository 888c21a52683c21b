"""How a policy learns in the environment: PPO of stable-baselines3, in place of the paper's A3C."""
