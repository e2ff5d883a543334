"""``landing results``: look at, export, draw, verify and compare result files."""

from __future__ import annotations

from landing_cli.cli.options import new_group

app = new_group("Look at, export, draw, verify and compare result files.")
