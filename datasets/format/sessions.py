"""The sessions of a dataset: who recorded, with what, and whether they are done."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any, Literal

import zarr

from handsight.datasets.errors import CorruptDataError, HeaderError
from handsight.datasets.format.arrays import array_at, group_at
from handsight.datasets.format.header import canonical_json, config_digest, header_from_json, header_to_json
from handsight.datasets.format.provenance import code_version, package_versions, utc_now
from handsight.datasets.format.schema import SESSIONS
from handsight.datasets.format.typed import typed
from handsight.datasets.records import SessionHeader

SessionStatus = Literal["open", "sealed"]

_PROVENANCE = ("header", "config_digest", "code", "packages", "started")
_STATUS = ("status", "ended")
_ENCODING_FAILURES = (TypeError, ValueError, RecursionError)
"""What values raise that handsight never writes: NaN, and lists in lists without end."""


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
    provenance = {
        "header": header_to_json(header),
        "config_digest": config_digest(header),
        "code": code_version(),
        "packages": package_versions(),
        "started": utc_now(),
    }
    return {**provenance, "provenance_digest": _digest(provenance), **open_attributes()}


def open_attributes() -> dict[str, Any]:
    """Attributes that mark a session as open."""
    return _status_attributes({"status": "open", "ended": None})


def sealed_attributes() -> dict[str, Any]:
    """Attributes that mark a session as complete, now."""
    return _status_attributes({"status": "sealed", "ended": utc_now()})


def attributes_with_header(attributes: dict[str, Any], header: dict[str, Any]) -> dict[str, Any]:
    """The attributes of a recorded session with the header that a newer schema gives it.

    Raises:
        CorruptDataError: The attributes are damaged, which a new digest would hide.
        HeaderError: They make no session.
    """
    damage = attribute_damage(attributes)
    if damage:
        raise CorruptDataError(f"a session is damaged: {'; '.join(damage)}; restore the dataset from a copy")
    missing = [name for name in _PROVENANCE if name not in attributes]
    if missing:
        raise HeaderError(f"{', '.join(missing)} of a session are missing")
    renewed = {**attributes, "header": header, "config_digest": config_digest(header_from_json(header))}
    return {**renewed, "provenance_digest": _digest({name: renewed[name] for name in _PROVENANCE})}


def attribute_damage(attributes: dict[str, Any]) -> list[str]:
    """What is no longer as it was recorded among the attributes of a session, which no checksum of the store covers."""
    faults = []
    for name, covered in (("provenance_digest", _PROVENANCE), ("status_digest", _STATUS)):
        recorded = attributes.get(name)
        if recorded is not None and recorded != _digest_of_any({key: attributes.get(key) for key in covered}):
            faults.append(f"{', '.join(covered)} are not as recorded")
    return faults


def read_sessions(root: zarr.Group) -> tuple[SessionInfo, ...]:
    """All sessions, in the order in which they began.

    Raises:
        CorruptDataError: What describes a session is damaged.
    """
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


def session_from_attributes(ulid: str, attributes: object, *, attempts: int) -> SessionInfo:
    """The session that a group's attributes describe.

    Raises:
        HeaderError: They were not written by handsight; every fault is said.
    """
    if not isinstance(attributes, dict):
        raise HeaderError(f"the attributes are a {type(attributes).__name__}, expected those of a session")
    described = {name: attributes[name] for name in (*_PROVENANCE, *_STATUS) if name in attributes}
    return typed(SessionInfo, {**described, "ulid": ulid, "attempts": attempts})


def _read_session(group: zarr.Group, ulid: str) -> SessionInfo:
    rows = array_at(group, "attempts/number").shape[0]
    try:
        return session_from_attributes(ulid, group.attrs.asdict(), attempts=rows)
    except HeaderError as error:
        raise CorruptDataError(
            f"session {ulid} cannot be read: {error}; restore the dataset from a copy, or open a version from before "
            "it, one of those that the log lists"
        ) from error


def _status_attributes(status: dict[str, Any]) -> dict[str, Any]:
    return {**status, "status_digest": _digest(status)}


def _digest_of_any(attributes: dict[str, Any]) -> str | None:
    """The digest of attributes that may be damaged; None where they have none."""
    try:
        return _digest(attributes)
    except _ENCODING_FAILURES:
        return None


def _digest(attributes: dict[str, Any]) -> str:
    return hashlib.sha256(canonical_json(attributes).encode()).hexdigest()
