"""Recordings of attempts, made when they are first asked for, kept for the next time, and bounded on disk."""

from __future__ import annotations

import re
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from handsight.viz.browser.rows import NO_LABEL

Kind = Literal["card", "attempt"]
KINDS: tuple[Kind, ...] = ("card", "attempt")
ON_SCREEN = 128
"""So many recordings that were asked for last are never deleted: they are being looked at."""
_NAMED = re.compile(rb"(card|attempt)-([0-9A-HJKMNP-TV-Z]{26}-[0-9]{6,})(?![0-9])")


def recording_id(kind: Kind, attempt: str) -> str:
    """The id of a recording, by which the viewer asks for it. Its kind begins it, lest half of a name mean another."""
    return f"{kind}-{attempt}"


@dataclass(frozen=True, slots=True)
class Wanted:
    """A recording that somebody asks for."""

    kind: Kind
    attempt: str


def wanted_in(piece: bytes) -> set[Wanted]:
    """The recordings that bytes of a question name."""
    found = _NAMED.findall(piece)
    return {Wanted("card" if kind == b"card" else "attempt", attempt.decode("ascii")) for kind, attempt in found}


class Makes(Protocol):
    """Writes the recording of an attempt to a path."""

    def __call__(self, wanted: Wanted, path: Path) -> None:
        """Write it; what it raises leaves nothing there."""


class Shelf:
    """Two folders of recordings. Safe to be asked from several threads; recordings are made one at a time.

    What was recorded of an attempt never changes, and its id is its own: cards are kept for all versions and datasets,
    by id and label. What an attempt's recording says changes with every decision, so those are kept for one browser.

    Args:
        cards: Where cards are kept; what is there already is used.
        attempts: Where recordings of attempts are kept.
        label_of: The label of each attempt that there are recordings of; others are not asked for.
        make: Writes one.
        register: Told of recordings before anybody is answered, each once.
        forget: Told the ids of recordings that are about to be deleted.
        limit_bytes: How much the folders may hold; what was not asked for the longest is deleted first.
    """

    def __init__(
        self,
        *,
        cards: Path,
        attempts: Path,
        label_of: Mapping[str, str],
        make: Makes,
        register: Callable[[Kind, list[Path]], None],
        forget: Callable[[Kind, list[str]], None],
        limit_bytes: int,
    ) -> None:
        self._folders: dict[Kind, Path] = {"card": cards, "attempt": attempts}
        self._labels = dict(label_of)
        self._make = make
        self._register = register
        self._forget = forget
        self._limit_bytes = limit_bytes
        self._lock = threading.Lock()
        self._shown: OrderedDict[Wanted, Path] = OrderedDict()
        for folder in self._folders.values():
            folder.mkdir(parents=True, exist_ok=True)
        self._sizes = _kept(cards)
        self.made = 0
        """Recordings that were not there when they were asked for."""
        self.failed: dict[Wanted, Exception] = {}
        """Those that could not be made, and why."""

    @property
    def bytes_kept(self) -> int:
        """What the recordings take on disk."""
        with self._lock:
            return sum(self._sizes.values())

    def ready(self, piece: bytes) -> None:
        """See to it that what bytes of a question name is there; the door before the catalog calls this."""
        wanted = {one for one in wanted_in(piece) if one.attempt in self._labels}
        if wanted:
            self.provide(sorted(wanted, key=lambda one: one.attempt))

    def provide(self, wanted: Iterable[Wanted]) -> None:
        """Make and register the recordings that are not yet known to the catalog.

        One that cannot be made is remembered in :attr:`failed` and shows as missing: the others are still wanted.
        """
        with self._lock:
            new: dict[Kind, list[Path]] = {kind: [] for kind in KINDS}
            for one in wanted:
                if one in self._shown:
                    self._shown.move_to_end(one)
                elif one not in self.failed and (path := self._there(one)) is not None:
                    self._shown[one] = path
                    new[one.kind].append(path)
            for kind, paths in new.items():
                if paths:
                    self._register(kind, paths)
            self._make_room()

    def decided(self, labels: Mapping[str, str]) -> None:
        """Curation has given attempts these labels, or said something else of them: they are made anew when asked for.

        Args:
            labels: The label of each attempt concerned, whether it is another one or not.
        """
        with self._lock:
            for attempt, label in labels.items():
                self._labels[attempt] = label
                for kind in KINDS:
                    path = self._withdraw(Wanted(kind, attempt))
                    if kind == "attempt" and path is not None:
                        self._delete(path)

    def _path(self, wanted: Wanted) -> Path:
        if wanted.kind == "attempt":
            return self._folders["attempt"] / f"{wanted.attempt}.rrd"
        session, _, number = wanted.attempt.partition("-")
        label = self._labels[wanted.attempt].replace(NO_LABEL, "none")
        return self._folders["card"] / session / f"{number}-{label}.rrd"

    def _there(self, wanted: Wanted) -> Path | None:
        path = self._path(wanted)
        if path not in self._sizes:
            try:
                path.parent.mkdir(exist_ok=True)
                self._make(wanted, path)
            except Exception as error:  # Damage of one attempt, a full disk: the viewer shows what else there is.
                self.failed[wanted] = error
                return None
            self.made += 1
            self._sizes[path] = path.stat().st_size
        return path

    def _make_room(self) -> None:
        total = sum(self._sizes.values())
        if total <= self._limit_bytes:
            return
        shown = set(self._shown.values())
        for path in [path for path in self._sizes if path not in shown]:
            if total <= self._limit_bytes:
                return
            total -= self._delete(path)
        for one in list(self._shown)[:-ON_SCREEN]:
            if total <= self._limit_bytes:
                return
            withdrawn = self._withdraw(one)
            total -= 0 if withdrawn is None else self._delete(withdrawn)

    def _withdraw(self, wanted: Wanted) -> Path | None:
        """Take a recording out of the catalog; returns where it is kept, if it was there."""
        path = self._shown.pop(wanted, None)
        if path is not None:
            self._forget(wanted.kind, [recording_id(wanted.kind, wanted.attempt)])
        return path

    def _delete(self, path: Path) -> int:
        path.unlink(missing_ok=True)
        return self._sizes.pop(path, 0)


def _kept(folder: Path) -> dict[Path, int]:
    """Sizes of the recordings that are there, what was written the longest ago first."""
    found = [(path, path.stat()) for path in folder.glob("*/*.rrd")]
    return {path: stat.st_size for path, stat in sorted(found, key=lambda one: one[1].st_mtime)}
