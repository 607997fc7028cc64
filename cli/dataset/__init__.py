"""``handsight dataset``: one file for each group of its commands."""
