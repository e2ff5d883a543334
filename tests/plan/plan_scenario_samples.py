"""A planning scenario over the lumpy body, as files."""

from __future__ import annotations

from pathlib import Path

from planning_samples import lumpy_mesh

from landing_cli.sources.shape_files import write_obj

SCENARIO = """\
name: lumpy
body:
  shape: lumpy.obj
  length_unit: km
  origin: file
  rotation_rate_rad_s: 3.3117e-4
  epoch_utc: 2030-05-01T00:00:00
  gravity: {model: point_mass, gm_m3_s2: 4.4628e5}
spacecraft: {mass_kg: 500, thrust_max_n: 60, isp_s: 150}
plan:
  initial_state: {position_km: [-33.8, -9.06, 0], velocity_m_s: [-0.9, 3.4, 0]}
  site: {lon_lat_deg: [90, 0]}
  tof_s: 2000
  clearance_m: 300
  bezier: {coarse_points: 9, fine_points: 5, samples: 101}
"""


def write_lumpy(folder: Path, text: str = SCENARIO) -> Path:
    """Write the scenario and its shape; return the scenario's path."""
    write_obj(folder / "lumpy.obj", lumpy_mesh(), ["a test body"], "km")
    path = folder / "lumpy.yaml"
    path.write_text(text)
    return path
