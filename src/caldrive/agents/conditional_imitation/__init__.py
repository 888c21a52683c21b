"""Conditional imitation learning (Codevilla et al., ICRA 2018), as the CARLA paper compares it: an image, the speed and
a command straight to steering, throttle and brake."""
