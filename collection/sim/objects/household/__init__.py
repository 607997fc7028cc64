"""Household objects, generated: solids, finishes, builders by kind, the table that lists them, and their writer."""
