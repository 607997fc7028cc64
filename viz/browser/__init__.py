"""The dataset browser: attempts as cards in the Rerun viewer, recordings made when they are looked at."""
