from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import resource, torch
from handsight.training.memory import keep_freed_memory

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        torch.ones(1_000_000), torch.ones(2_000_000)  # freed again at once
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

kept = keep_freed_memory()
faults()
print(kept, faults())
"""


def test_what_is_freed_is_used_again_without_the_kernel() -> None:
    """Each of these 40 blocks has about a thousand pages or more."""
    done = subprocess.run([sys.executable, "-P", "-c", PROGRAM], capture_output=True, text=True, check=True)
    kept, faults = done.stdout.split()
    assert kept == str(sys.platform == "linux")
    if kept == "True":
        assert int(faults) < 1000
