"""Errors of the viz room.

VizError
├── RecordingError (ValueError)        something that cannot be drawn: nothing in it, or parts that do not match
├── FigureError (ValueError)           rows or pictures of which no figure can be made
├── BrowserError (ValueError)          nothing to browse, or no place to serve it at
├── ReportError (ValueError)           what no report can be made of, or no place to write one to
├── ViewerError (RuntimeError)         no window or page can be opened here
└── ScreenshotError (RuntimeError)     the headless viewer gave no picture
    └── NoVulkanError                  no Vulkan driver for the viewer to draw with
"""


class VizError(Exception):
    """Base of every error raised in ``handsight.viz``."""


class RecordingError(VizError, ValueError):
    """Something that cannot be drawn: nothing in it, or parts that do not match."""


class FigureError(VizError, ValueError):
    """Rows or pictures of which no figure can be made."""


class BrowserError(VizError, ValueError):
    """Nothing to browse, or no place to serve it at."""


class ReportError(VizError, ValueError):
    """What no report can be made of, or no place to write one to."""


class ViewerError(VizError, RuntimeError):
    """No window or page can be opened here."""


class ScreenshotError(VizError, RuntimeError):
    """The headless viewer gave no picture."""


class NoVulkanError(ScreenshotError):
    """No Vulkan driver for the viewer to draw with."""
