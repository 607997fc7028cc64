"""The ``handsight`` command: one file per noun, thin; the only place that wires concrete parts together."""
