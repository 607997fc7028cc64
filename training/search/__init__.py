"""The search for a better recipe: proposals by Optuna, judged by cross-validated cells as those of a sweep."""
