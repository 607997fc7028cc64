"""Concrete parts put together for the commands: stations, policies, renderers by name."""
