"""Songs for training, tests and benchmarks whose counts are known."""
