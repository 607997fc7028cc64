"""Recordings for the Rerun viewer. The only place that imports Rerun."""
