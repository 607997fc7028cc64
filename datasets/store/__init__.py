"""A dataset with its history: branches, releases, durable commits. The only place that imports Icechunk."""
