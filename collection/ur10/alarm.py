"""Telling somebody outside this machine that the rig waits for a person."""

from __future__ import annotations

import json
import subprocess
import urllib.request

from handsight.collection.ur10.rig import AlarmConfig


def sound_alarm(config: AlarmConfig, text: str) -> list[str]:
    """Run the command and call the webhook; returns what of that failed, for the log. It raises nothing.

    Args:
        config: Who is told.
        text: One line.
    """
    faults = []
    if config.command:
        try:
            done = subprocess.run(
                (*config.command, text), timeout=config.timeout_s, capture_output=True, text=True, check=False
            )
            if done.returncode:
                faults.append(f"alarm command ended with status {done.returncode}: {done.stderr.strip()[:200]}")
        except (OSError, subprocess.TimeoutExpired) as error:
            faults.append(f"alarm command: {error}")
    if config.webhook:
        request = urllib.request.Request(
            config.webhook, data=json.dumps({"text": text}).encode(), headers={"Content-Type": "application/json"}
        )
        try:
            with urllib.request.urlopen(request, timeout=config.timeout_s):
                pass
        except (OSError, ValueError) as error:
            faults.append(f"alarm webhook: {error}")
    return faults
