"""Who is recorded as the author, in a container too."""

from __future__ import annotations

import os
import pwd

import pytest

from handsight.cli.dataset.author import author_named

NAMES = ("LOGNAME", "USER", "LNAME", "USERNAME")


def nobody(uid: int) -> pwd.struct_passwd:
    raise KeyError(f"getpwuid(): uid not found: {uid}")


def test_a_user_without_a_name_is_recorded_by_number(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", nobody)
    assert author_named("") == f"uid {os.getuid()}"
    assert author_named("anna") == "anna"


def test_a_user_is_recorded_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOGNAME", "berta")
    assert author_named("") == "berta"
