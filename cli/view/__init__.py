"""``handsight view``: what there is to look at in the Rerun viewer."""
