"""Scenarios and YAML texts that the tests of scenarios and commands share."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SHIPPED = sorted((ROOT / "configs").glob("**/*.yaml"))

MINIMAL = """\
name: probe
body:
  shape: octahedron.obj
  length_unit: m
  rotation_period_h: 5
  gravity: {model: point_mass, density_kg_m3: 2000}
spacecraft: {mass_kg: 1000, thrust_max_n: 10, isp_s: 300}
reach:
  initial_states:
    - {name: top, position_m: [0, 0, 900]}
  tof_s: [700, 900]
  final_stage_s: 200
"""

OCTAHEDRON = """\
v 300 0 0
v -300 0 0
v 0 250 0
v 0 -250 0
v 0 0 200
v 0 0 -200
f 1 3 5
f 3 2 5
f 2 4 5
f 4 1 5
f 3 1 6
f 2 3 6
f 4 2 6
f 1 4 6
"""


def write_minimal(folder: Path, text: str = MINIMAL, name: str = "probe.yaml") -> Path:
    """Write a small scenario and its shape; return the scenario's path."""
    (folder / "octahedron.obj").write_text(OCTAHEDRON)
    path = folder / name
    path.write_text(text)
    return path
