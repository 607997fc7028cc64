"""Errors of the viz room.

VizError
├── RecordingError (ValueError)        something that cannot be drawn: nothing in it, or parts that do not match
├── FigureError (ValueError)           rows or pictures of which no figure can be made
└── ScreenshotError (RuntimeError)     the headless viewer gave no picture
    └── NoVulkanError                  no Vulkan driver for the viewer to draw with
"""


class VizError(Exception):
    """Base of every error raised in ``handsight.viz``."""


class RecordingError(VizError, ValueError):
    """Something that cannot be drawn: nothing in it, or parts that do not match."""


class FigureError(VizError, ValueError):
    """Rows or pictures of which no figure can be made."""


class ScreenshotError(VizError, RuntimeError):
    """The headless viewer gave no picture."""


class NoVulkanError(ScreenshotError):
    """No Vulkan driver for the viewer to draw with."""
