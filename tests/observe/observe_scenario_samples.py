"""An observation scenario over a smooth small body, as files."""

from __future__ import annotations

from pathlib import Path

from shape_helpers import fibonacci_ellipsoid

from landing_cli.sources.shape_files import write_obj

SCENARIO = """\
name: pebble
body:
  shape: pebble.obj
  length_unit: m
  rotation_rate_rad_s: 2e-4
  epoch_utc: 2030-05-01T00:00:00
  gravity: {model: point_mass, density_kg_m3: 2000}
spacecraft: {mass_kg: 500, thrust_max_n: 60, isp_s: 220}
observe:
  initial_state: {site_position_m: [-60, 70, 90]}
  site: {lon_lat_deg: [0, 40]}
  tof_s: 600
  landmarks:
    synthetic: {seed: 3, clusters: 3, mean_per_cluster: 8, spread_m: 12, extent_m: 90}
  sensor:
    kind: lidar
    half_field_of_view_deg: 50
    range_max_m: 500
    range_sigma_m: 0.1
    angle_sigma_deg: 0.05
    rate_hz: 0.1
  prior: {position_sigma_m: 5, velocity_sigma_m_s: 0.05, acceleration_noise_m2_s3: 1e-9}
  steering: {waypoints: [0, 3], nodes: 60}
  information: {weight: 0.1, knots: 3}
"""


def write_pebble(folder: Path, text: str = SCENARIO) -> Path:
    """Write the scenario and its shape, 900 x 700 x 600 m; return the scenario's path."""
    mesh = fibonacci_ellipsoid((450.0, 350.0, 300.0), 300)
    write_obj(folder / "pebble.obj", mesh, ["a test body"], "m")
    path = folder / "pebble.yaml"
    path.write_text(text)
    return path
