"""Dispersions that several tests share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from landing_cli.parallel.plan import WorkPlan
from landing_cli.scenario.load import load
from landing_cli.studies.disperse.pipeline import RunOptions, run
from landing_cli.studies.disperse.records import DispersionRun, Drawing, Spread

SAMPLES, FACETS = 10, 80

SCENARIO = """\
name: boulder
body:
  shape: boulder.obj
  length_unit: m
  rotation_period_h: 4.288
  gravity: {model: harmonics, gm_m3_s2: 4.9}
spacecraft: {mass_kg: 2000, thrust_max_n: 20, isp_s: 400}
reach:
  initial_states:
    - {name: high, position_m: [500, 200, 600], velocity_m_s: [0.05, -0.03, 0.02]}
  tof_s: [700, 600]
  final_stage_s: 200
disperse:
  samples: 10
  position_sigma_m: [10, 10, 10]
  velocity_sigma_m_s: [0.01, 0.01, 0.01]
  mass_sigma_relative: 0.005
  thrust_sigma_relative: 0.05
  gm_sigma_relative: 0.01
plan:
  initial_state: {position_m: [500, 200, 600]}
  site: {facet: 0}
  tof_s: 700
"""


def write_boulder(folder: Path, text: str = SCENARIO) -> Path:
    """Write the scenario and its shape of 80 facets; return the scenario's path."""
    sphere = trimesh.creation.icosphere(subdivisions=1)
    vertices = np.asarray(sphere.vertices) * (280.0, 260.0, 240.0)
    lines = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in np.asarray(sphere.faces) + 1]
    (folder / "boulder.obj").write_text("\n".join(lines) + "\n")
    path = folder / "boulder.yaml"
    path.write_text(text)
    return path


def solve_boulder(folder: Path, *overrides: str, **plan: Any) -> DispersionRun:
    """Solve it into ``folder/run.h5``."""
    loaded = load(str(write_boulder(folder)), overrides)
    options = RunOptions(WorkPlan(**plan))
    return run(loaded, folder / "run.h5", options, lambda done, total: None).run


def spread(**changes: Any) -> Spread:
    """Nothing dispersed, but for what is given."""
    given = {
        "axes": "body",
        "state_factor": np.zeros((6, 6)),
        "mass_sigma_kg": 0.0,
        "thrust_sigma_n": 0.0,
        "gm_sigma_m3_s2": 0.0,
    }
    return Spread(**(given | changes))


def drawing(samples: int, seed: int = 1, confidence: float = 0.95, **changes: Any) -> Drawing:
    return Drawing(seed, samples, confidence, spread(**changes))
