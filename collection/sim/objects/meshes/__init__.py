"""Meshes that a user brings: found, checked, cut into convex parts, and written as an object set."""
