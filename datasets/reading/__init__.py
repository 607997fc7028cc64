"""Reading one version of a dataset, and comparing versions."""
