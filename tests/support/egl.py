"""A machine without EGL."""

from __future__ import annotations

NO_EGL = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent"}
"""Makes libEGL find no driver, as on a machine without one."""
