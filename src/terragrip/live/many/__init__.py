"""Many vehicles in one process: one connection, an estimator each."""
