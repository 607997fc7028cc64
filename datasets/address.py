"""How a version of a dataset is named: ``PATH`` or ``PATH@REF``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from handsight.datasets.errors import AddressError

DEFAULT_REF = "main"
"""The branch that is read where the address names no ref."""

_URL_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetAddress:
    """A local dataset folder and the version of it that is meant."""

    path: Path
    """The folder of the dataset."""
    ref: str = DEFAULT_REF
    """A release, a branch or a snapshot id, looked up in this order."""

    @classmethod
    def parse(cls, text: str) -> DatasetAddress:
        """Read ``PATH[@REF]``.

        Only the last component of the path is split, at its last ``@``, so parent folders may contain the sign.

        Raises:
            AddressError: The path or the ref is empty, or the text is a URL.
        """
        if _URL_SCHEME.match(text):
            raise AddressError(f"dataset address is {text!r}, expected a local folder: copy the dataset to disk first")
        parent, slash, last = text.rstrip("/").rpartition("/")
        name, ref = last.rsplit("@", 1) if "@" in last else (last, DEFAULT_REF)
        if not ref:
            raise AddressError(f"dataset address {text!r} ends in '@': name a release, branch or snapshot, or drop it")
        if not name:
            raise AddressError(f"dataset address is {text!r}, expected PATH or PATH@REF with a folder name in PATH")
        return cls(path=Path(parent + slash + name), ref=ref)

    def __str__(self) -> str:
        return f"{self.path}@{self.ref}"
