"""Is a dataset as it was recorded, and fit to learn from: verify, doctor, repair, migrate, disk space."""
