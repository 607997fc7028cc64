"""Addresses of viewers that watch, checked before anything slow is imported."""

from __future__ import annotations

from urllib.parse import urlsplit

from handsight.viz.errors import ViewerError


def check_live_url(url: str) -> str:
    """The address of a viewer.

    Raises:
        ViewerError: It is none.
    """
    fault = ViewerError(f"the viewer's address is {url!r}, expected one such as rerun+http://127.0.0.1:9876/proxy")
    try:
        parts = urlsplit(url)
        _ = parts.port
    except ValueError as error:
        raise fault from error
    if parts.scheme not in ("rerun+http", "rerun+https") or not parts.hostname or parts.path != "/proxy":
        raise fault
    return url
