"""Recording sessions, and every other change of a branch as one commit."""
