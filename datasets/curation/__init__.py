"""Decisions about attempts, folds and saved filters: layers over what was recorded, which none of them changes."""
