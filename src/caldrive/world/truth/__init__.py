"""What is true: the affordances' labels and the ground under the car."""
