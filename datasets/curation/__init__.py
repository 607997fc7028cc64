"""Decisions about attempts, folds and saved views: layers over what was recorded, which none of them changes."""
