"""What a rig tells: alarms, heartbeat, operator log, and who its arm is."""

from __future__ import annotations

import json
import struct
import sys
from pathlib import Path

import pytest
from tests.support.line_server import answering
from tests.support.small_disk import files_of_at_most

from handsight.collection.errors import RigPausedError
from handsight.collection.ur10.alarm import sound_alarm
from handsight.collection.ur10.kinematics import checksums_in, kinematics_id
from handsight.collection.ur10.logs import Heartbeat, OperatorLog
from handsight.collection.ur10.rig import AlarmConfig


def test_the_command_gets_the_text_last(tmp_path: Path) -> None:
    out = tmp_path / "said"
    program = f"import sys; open({str(out)!r}, 'w').write(sys.argv[-1])"
    assert sound_alarm(AlarmConfig(command=(sys.executable, "-c", program)), "the rig paused") == []
    assert out.read_text(encoding="utf-8") == "the rig paused"


def test_the_webhook_gets_the_text_as_json() -> None:
    got: list[bytes] = []

    def answer(data: bytes) -> bytes:
        got.append(data)
        return b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"

    with answering(answer) as (address, port):
        assert sound_alarm(AlarmConfig(webhook=f"http://{address}:{port}/hook", timeout_s=5.0), "paused") == []
    assert b'{"text": "paused"}' in b"".join(got)


def test_an_alarm_that_fails_is_told_and_raises_nothing() -> None:
    config = AlarmConfig(
        command=(sys.executable, "-c", "import sys; sys.exit('no modem')"), webhook="http://127.0.0.1:9/x"
    )
    said = sound_alarm(config, "paused")
    assert ["no modem" in said[0], said[1].startswith("alarm webhook")] == [True, True]
    assert sound_alarm(AlarmConfig(command=("/no/such/program",)), "paused")[0].startswith("alarm command")
    assert sound_alarm(AlarmConfig(), "paused") == []


def test_the_heartbeat_is_one_whole_file(tmp_path: Path) -> None:
    heartbeat = Heartbeat(tmp_path / "rig" / "heartbeat.json")
    heartbeat.beat("working", phase="look")
    heartbeat.beat("paused", reason="refill")
    values = json.loads(heartbeat.path.read_text(encoding="utf-8"))
    assert (values["state"], values["reason"]) == ("paused", "refill")
    assert [path.name for path in heartbeat.path.parent.iterdir()] == ["heartbeat.json"]


@pytest.mark.parametrize("what", ["log", "heartbeat"])
def test_a_rig_that_cannot_write_pauses(tmp_path: Path, what: str) -> None:
    log, heartbeat = OperatorLog(tmp_path / "log.jsonl", who="ana"), Heartbeat(tmp_path / "heartbeat.json")
    name = "log.jsonl" if what == "log" else "heartbeat.json"
    with files_of_at_most(0), pytest.raises(RigPausedError, match=f"{name} cannot be written .*--resume"):
        log.note("refilled") if what == "log" else heartbeat.beat("working")


def test_the_operator_log_says_who_when_and_what(tmp_path: Path) -> None:
    log = OperatorLog(tmp_path / "log.jsonl", who="ana")
    log.note("refilled", objects=12)
    log.note("pads changed")
    first, second = map(json.loads, log.path.read_text(encoding="utf-8").splitlines())
    assert (first["who"], first["what"], first["objects"], second["what"]) == ("ana", "refilled", 12, "pads changed")
    assert first["at"].endswith("+00:00")


def message(*parts: tuple[int, bytes]) -> bytes:
    body = b"".join(struct.pack(">IB", 5 + len(data), kind) + data for kind, data in parts)
    return struct.pack(">IB", 5 + len(body), 16) + body


def test_the_arm_is_known_by_the_checksums_of_its_kinematics() -> None:
    sums = struct.pack(">6I", *range(1, 7)) + bytes(8 * 24 + 4)
    said = message((0, bytes(30)), (5, sums))
    expected = "".join(f"{n:08x}" for n in range(1, 7))
    assert checksums_in(said[4:]) == expected
    with answering(lambda got: b"", greeting=message((0, bytes(9))) + said) as (address, port):
        assert kinematics_id(address, port, timeout_s=5.0) == expected


def test_a_controller_that_keeps_it_to_itself_is_no_error() -> None:
    assert checksums_in(b"\x14" + bytes(40)) is None
    assert checksums_in(message((5, bytes(8)))[4:]) is None
    with answering(lambda got: b"", greeting=message((0, bytes(9)))) as (address, port):
        assert kinematics_id(address, port, timeout_s=0.2) is None
