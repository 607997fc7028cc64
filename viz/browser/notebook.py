"""A dataset's cards in a cell of a notebook: the page for web browsers, in a frame.

Rerun has a widget for notebooks, a package of its own that fetches its viewer from its maker's server. A frame asks
nobody but this machine, and needs no package. The web browser has to run on the kernel's machine.
"""

from __future__ import annotations

import html
import weakref
from contextlib import ExitStack

from handsight.viz.browser.browser import Browser
from handsight.viz.browser.decisions import Decided
from handsight.viz.browser.viewer import web_viewer

HEIGHT_PX = 720


def cell_lines(page: str) -> str:
    """What to paste into a cell, for it to show a page."""
    return f'from IPython.display import IFrame\nIFrame({page!r}, width="100%", height={HEIGHT_PX})'


class NotebookBrowser:
    """A browser that shows itself where it is the value of a cell, until it is closed or the kernel ends.

    Args:
        browser: Serves the cards; it is closed with this.
        port: Of the page; 0 for any free one.

    Raises:
        ViewerError: The page cannot be served, as where the port is in use; the browser is closed then.
    """

    def __init__(self, browser: Browser, *, port: int = 0) -> None:
        self._browser = browser
        with ExitStack() as opened:
            opened.callback(browser.close)
            self.page = opened.enter_context(web_viewer(browser.address, port=port)).page
            """What the frame shows; any web browser of this machine can."""
            self.close = weakref.finalize(self, opened.pop_all().close)
            """Serve no more; nothing happens the second time."""

    def decide(self) -> list[Decided]:
        """Take the decisions that were clicked since the last call."""
        return self._browser.decide_edits()

    def _repr_html_(self) -> str:
        attributes = f'src="{html.escape(self.page)}" title="attempts as cards" width="100%" height="{HEIGHT_PX}"'
        return f'<iframe {attributes} style="border: 0"></iframe>'
