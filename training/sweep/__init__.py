"""Sweeps: many small trainings, cross-validated, over channels, sizes of the training set and parts of the recipe."""
