"""The landing cases of a scenario."""

from __future__ import annotations

import math

import numpy as np

from landing_cli.reach.records import FreeFinalStage, LandingCase
from landing_cli.scenario.build import Built
from landing_cli.scenario.schema import Reach


def landing_cases(reach: Reach, built: Built) -> tuple[tuple[str, LandingCase], ...]:
    """Make every case of a scenario, in its order, each with the name of its initial state."""
    return tuple(
        (
            state.name,
            LandingCase(
                name=name,
                asteroid=built.asteroid,
                spacecraft=built.spacecraft,
                position_m=np.array(state.start_m, dtype=np.float64),
                velocity_m_s=np.array(state.velocity_m_s, dtype=np.float64),
                tof_s=tof_s,
                final_stage_s=_usual_stage_s(reach, tof_s),
                ellipsoid_m=np.asarray(built.ellipsoid_m, dtype=np.float64),
                glide_slope_half_angle_rad=math.radians(reach.glide_slope_half_angle_deg),
                handover=reach.handover,
                final_stage_thrust=reach.final_stage_thrust,
                descent=reach.descent,
                terrain=reach.terrain,
                margin=reach.margin,
                free_final_stage=_free_stage(reach, tof_s),
            ),
        )
        for name, state, tof_s in reach.cases()
    )


def _free_stage(reach: Reach, tof_s: float) -> FreeFinalStage | None:
    """Durations that the final stage may take, where it is free."""
    if isinstance(reach.final_stage_s, float):
        return None
    return FreeFinalStage(*reach.final_stages_s(tof_s), reach.final_stage_compared_s)


def _usual_stage_s(reach: Reach, tof_s: float) -> float:
    """The final stage's duration, or where it is free the compared one, or the middle of the range."""
    return reach.final_stage_compared_s or sum(reach.final_stages_s(tof_s)) / 2.0
