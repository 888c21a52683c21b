"""A search for the task blocks' hyperparameters, as in the paper's supplement."""
