"""Import of sets that others recorded, as a map says: what their label is, their picture, their pose, their camera."""
