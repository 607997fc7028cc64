"""Programs of other people, measured on the same machine in the same run."""
