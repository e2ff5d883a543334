"""The numbers that an observation is summed up in."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from landing_cli.observe.observed import ObservedPath, Path
from landing_cli.observe.path_samples import positions_at
from landing_cli.observe.records import ObserveCase
from landing_cli.observe.stored import ObservationEntry


def summarise(entry: ObservationEntry) -> dict[str, Any]:
    """Sum up an observation, as ``plan observe --json`` prints it.

    Parameters
    ----------
    entry : ObservationEntry
        The observation and what was asked.

    Returns
    -------
    dict
        The contract's fields for the steered path; the same for the unsteered one under ``nominal``.
    """
    observation, case = entry.observation, entry.case
    waypoints, clusters = observation.waypoints, observation.clustering
    told: dict[str, Any] = {
        "name": entry.name,
        "method": "observe",
        "objective": observation.objective,
        "waypoints": 0 if waypoints is None else len(waypoints.t_s),
        **path_summary(observation.steered, case),
        "cpu_s": entry.cpu_s,
        "iterations": observation.steered.path.iterations,
        "nominal": path_summary(observation.nominal, case),
        "landmarks": len(case.landmarks.position_m),
        "illumination": observation.steered.seen.lit,
        "frame": case.frame.kind,
        "site_m": case.frame.origin_m,
        "site_normal": case.frame.normal,
        "site_facet": case.frame.facet if case.frame.facet >= 0 else None,
    }
    if waypoints is not None:
        told |= {
            "waypoint_timing": waypoints.timing,
            "waypoint_t_s": waypoints.t_s,
            "waypoint_m": waypoints.position_m,
            "curve_m": waypoints.curve_m,
        }
    told["clusters"] = {
        "k": len(clusters.center_m),
        "k_chosen_by": clusters.chosen_by,
        "center_m": clusters.center_m,
        "side": ["left" if side > 0 else "right" for side in clusters.side],
        "steered_to": clusters.steered_to,
        "side_chosen_by": clusters.side_chosen_by,
        "control_points_m": clusters.control_points_m,
        "sse_m2": clusters.sse_m2,
    }
    return told | {key: value for key, value in observation.parameters.items() if key not in told}


def path_summary(observed: ObservedPath, case: ObserveCase) -> dict[str, Any]:
    """Sum up a path and what it sees.

    Parameters
    ----------
    observed : ObservedPath
        The path.
    case : ObserveCase
        What was asked.

    Returns
    -------
    dict
    """
    path, seen, sigma = observed.path, observed.seen, observed.sigma
    return {
        "status": path.status,
        "message": path.message,
        "tof_s": path.tof_s,
        "fuel_kg": path.propellant_mass_fraction * case.spacecraft.mass_kg,
        "delta_v_m_s": path.delta_v_m_s,
        "propellant_mass_fraction": path.propellant_mass_fraction,
        "performance_index_m2_s3": path.performance_index_m2_s3,
        "peak_thrust_n": path.peak_thrust_n,
        "clearance_min_m": path.clearance_min_m if math.isfinite(path.clearance_min_m) else None,
        "clearance_metric": "surface",
        "landing_angle_deg": landing_angle_deg(path, case),
        "glide_slope_max_deg": math.degrees(path.glide_slope_max_rad),
        "features_seen": {
            "distinct": seen.distinct,
            "mean_in_view": seen.mean_in_view,
            "longest_gap_s": seen.longest_gap_s,
        },
        "not_seen_because": dict(seen.rejected),
        "position_sigma_m": {"mean": sigma.mean_m, "final": sigma.final_m},
    }


def landing_angle_deg(path: Path, case: ObserveCase) -> float:
    """Angle between the line from the site to the spacecraft and the facet's normal, 1 s before touchdown.

    Parameters
    ----------
    path : Path
        The path.
    case : ObserveCase
        What was asked.

    Returns
    -------
    float, deg
    """
    offset = positions_at(path, np.array([max(0.0, path.tof_s - 1.0)]))[0] - case.frame.origin_m
    distance = float(np.linalg.norm(offset))
    cosine = float(offset @ case.frame.normal) / distance if distance > 0.0 else 1.0
    return math.degrees(math.acos(min(1.0, max(-1.0, cosine))))
