"""The modular pipeline of the CARLA paper: perception, a rule-based planner, and a PID controller."""
