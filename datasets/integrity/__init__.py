"""Is a dataset as it was recorded, and without errors or warnings: verify, doctor, repair, migrate, disk space."""
