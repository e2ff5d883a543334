"""Bits flipped in results and journals: refused, or right."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from programs import Tally, environment

CODE = """
import random, sys
from pathlib import Path
from landing_cli.errors import InputRefused
from landing_cli.results.journal import read_journal
from landing_cli.results.store import read

def journal_facts(path):
    content = read_journal(path)
    if content is None or content.identity is None:
        return None, {}
    return content.identity, {k: [a.tobytes() for a in v.values()] for k, v in content.records.items()}

kind, path, flips = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
whole, chance = bytearray(path.read_bytes()), random.Random(0)
good = journal_facts(path) if kind == "journal" else read(path)
refused = wrong = 0
for _ in range(flips):
    place = chance.randrange(len(whole) * 8)
    whole[place // 8] ^= 1 << place % 8
    path.write_bytes(whole)
    whole[place // 8] ^= 1 << place % 8
    try:
        if kind == "journal":
            identity, records = journal_facts(path)
            wrong += identity not in (None, good[0]) or any(good[1].get(k) != v for k, v in records.items())
        else:
            read(path)
            wrong += 1  # no flipped result may be read at all
    except InputRefused:
        refused += 1
print(refused, wrong)
"""


def flip_bits(kind: str, path: Path, flips: int) -> Tally:
    """Flip random bits of a file, one at a time, and read it; in a process of its own, which may crash."""
    tally = Tally(f"bits flipped in a {kind}", tried=flips)
    command = [sys.executable, "-c", CODE, kind, str(path), str(flips)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment())
    if done.returncode:
        tally.failures = [f"crashed with {done.returncode}: {done.stderr[-300:]}"] * flips
        return tally
    _, wrong = map(int, done.stdout.split())
    tally.failures = ["read, though it was damaged"] * wrong
    return tally
