"""How a version of a dataset is named: ``PATH`` or ``PATH@REF``, where the path may be ``s3://BUCKET/PREFIX``."""

from __future__ import annotations

from dataclasses import dataclass

from handsight.datasets.errors import AddressError
from handsight.datasets.place import Place, place_of

DEFAULT_REF = "main"
"""The branch that is read where the address names no ref."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetAddress:
    """Where a dataset is and the version of it that is meant."""

    path: Place
    """The folder of the dataset, or its place in a bucket."""
    ref: str = DEFAULT_REF
    """A release, a branch or a snapshot id, looked up in this order."""

    @classmethod
    def parse(cls, text: str) -> DatasetAddress:
        """Read ``PATH[@REF]``.

        Only the last component of the path is split, at its last ``@``, so parent folders may contain the sign.

        Raises:
            AddressError: The path or the ref is empty, or the text is a URL of another kind than ``s3://``.
        """
        parent, slash, last = text.rstrip("/").rpartition("/")
        name, ref = last.rsplit("@", 1) if "@" in last else (last, DEFAULT_REF)
        if not ref:
            raise AddressError(f"dataset address {text!r} ends in '@': name a release, branch or snapshot, or drop it")
        if not name:
            raise AddressError(f"dataset address is {text!r}, expected PATH or PATH@REF with a folder name in PATH")
        return cls(path=place_of(parent + slash + name), ref=ref)

    def __str__(self) -> str:
        return f"{self.path}@{self.ref}"
