"""A fuzzer for the whole program: `python -m scripts.attack --inputs 2000`."""
