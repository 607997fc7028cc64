"""The sessions of a dataset: who recorded, with what, and whether they are done."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import zarr

from handsight.datasets.engine import array_at, group_at
from handsight.datasets.header import config_digest, header_from_json, header_to_json
from handsight.datasets.provenance import code_version, package_versions, utc_now
from handsight.datasets.records import SessionHeader
from handsight.datasets.schema import SESSIONS

SessionStatus = Literal["open", "sealed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionInfo:
    """One session as the dataset records it."""

    ulid: str
    """Names the session and sorts by the time at which it began."""
    header: SessionHeader
    config_digest: str
    """Equal for sessions that were set up alike, whatever their seeds."""
    code: dict[str, Any]
    """Version of handsight, git commit and whether the checkout was dirty; the last two None outside a checkout."""
    packages: dict[str, str]
    """Versions of the packages that can change what is recorded."""
    started: str
    """UTC, ISO 8601."""
    ended: str | None
    """UTC, ISO 8601; None while the session is open."""
    status: SessionStatus
    """``sealed`` once its collector has declared it complete."""
    attempts: int


def new_session_attributes(header: SessionHeader) -> dict[str, Any]:
    """Attributes of the group of a session that begins now."""
    return {
        "header": header_to_json(header),
        "config_digest": config_digest(header),
        "code": code_version(),
        "packages": package_versions(),
        "started": utc_now(),
        **open_attributes(),
    }


def open_attributes() -> dict[str, Any]:
    """Attributes that mark a session as open."""
    return {"status": "open", "ended": None}


def sealed_attributes() -> dict[str, Any]:
    """Attributes that mark a session as complete, now."""
    return {"status": "sealed", "ended": utc_now()}


def read_sessions(root: zarr.Group) -> tuple[SessionInfo, ...]:
    """All sessions, in the order in which they began."""
    sessions = group_at(root, SESSIONS)
    return tuple(_read_session(group_at(sessions, ulid), ulid) for ulid in sorted(sessions.group_keys()))


def matching_sessions(root: zarr.Group, header: SessionHeader) -> list[SessionInfo]:
    """Sessions with the header's source, seed and configuration, oldest first."""
    wanted = (header.station.source, header.seed, config_digest(header))
    return [
        session
        for session in read_sessions(root)
        if (session.header.station.source, session.header.seed, session.config_digest) == wanted
    ]


def _read_session(group: zarr.Group, ulid: str) -> SessionInfo:
    attributes: dict[str, Any] = group.attrs.asdict()
    return SessionInfo(
        ulid=ulid,
        header=header_from_json(attributes["header"]),
        config_digest=attributes["config_digest"],
        code=attributes["code"],
        packages=attributes["packages"],
        started=attributes["started"],
        ended=attributes["ended"],
        status=attributes["status"],
        attempts=array_at(group, "attempts/number").shape[0],
    )
