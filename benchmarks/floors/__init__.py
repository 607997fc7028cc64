"""What the floors are measured with: bare Icechunk, PNG, pinned processes, a million attempts."""
