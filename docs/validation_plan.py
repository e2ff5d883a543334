"""Plans to one site of Eros beside the figures that Lyu et al. (2026) print, and what explains the difference."""

# ruff: noqa: E501 (lines of the page)

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from validation_pseudospectral import pseudospectral_study
from validation_text import percent, table

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.errors import InputRefused
from landing_cli.flight.bezier_curve import first_control_points, last_control_points
from landing_cli.flight.legs import BezierLeg
from landing_cli.flight.peak_thrust import peak_acceleration
from landing_cli.plan.assess import Measured, measure
from landing_cli.plan.bezier import plan_bezier
from landing_cli.plan.bezier_free_guides import plan_bezier_free_guides
from landing_cli.plan.cases import plan_cases
from landing_cli.plan.convex import plan_convex
from landing_cli.plan.initial_states import even_longitudes, turned_cases
from landing_cli.plan.pseudospectral import plan_pseudospectral
from landing_cli.plan.records import (
    BezierOptions,
    ConvexOptions,
    FreeGuidesOptions,
    Plan,
    PlanCase,
    PseudospectralOptions,
)
from landing_cli.plan.shortest_time import plan_shortest_time, rule_time
from landing_cli.scenario.build import build_asteroid, build_spacecraft
from landing_cli.scenario.load import load
from landing_cli.sources.shape_search import find_shape

SCENARIO = Path(__file__).resolve().parent.parent / "configs" / "published" / "lyu2026-eros.yaml"
R_AC_M = np.array([-2001.35, 12095.55, -2235.11])  # printed, section 3.2
ALPHA_M = 2590.0  # of the printed r_ao, whose x and z are swapped
PUBLISHED_TIMES = {1689.96: (60.00, 31.47), 1800.0: (52.83, 29.53), 2000.0: (42.72, 26.56)}  # s: N, kg
DEGREES = (7, 8, 9, 11, 14)
LONGITUDES = 360

ABSENT = """## 8. Landing at one site

Not computed: the paper's case (`configs/published/lyu2026-eros.yaml`) needs the NEAR plate model of 7790 facets, which
is not shipped (`LANDING_REFERENCE_DATA`).
"""


def landing_plans() -> str:
    """Section 8: the paper's figures at its own guide points, every method, and what 26.39 kg may have been."""
    loaded = load(str(SCENARIO))
    try:
        find_shape(loaded.scenario.body.shape, SCENARIO.parent)
    except InputRefused:
        return ABSENT
    asteroid, _ = build_asteroid(loaded.scenario, SCENARIO.parent)
    case = plan_cases(loaded, asteroid, build_spacecraft(loaded.scenario))[0]
    return f"""## 8. Landing at one site

`configs/published/lyu2026-eros.yaml`, beside Lyu, Liang, Zhu and Ge (2026), "the paper" of this section. Its mesh is not
shipped; what follows was computed with it. Fuel of a plan is that of the constant mass which the scenario asks for.

### At the paper's own guide points

The printed `r_ac`, and `r_f + {ALPHA_M:g} n_f` for `r_ao`, whose printed x and z are swapped; {case.tof_s:g} s.

{_at_published_points(case)}

The paper measures clearance to the mesh's vertices: its own trajectory comes closer to the surface than its h_min of
{case.clearance_m:g} m. Its fuel lies between ours with point-mass and with polyhedral gravity, and between constant and
variable mass; which it used is not printed.

### Times of flight

{_times(case)}

The rule is the paper's eq 39, the plan our bracketed search, which takes the gentlest guide points and not the cheapest.

### Every method on the nominal case

{case.tof_s:g} s, point mass, constant mass, {case.clearance_m:g} m to the surface. The paper's rows are its Table 2. CPU is that of
the second of two runs, here; the paper's was measured elsewhere.

{_methods(case)}

Free control is the fuel optimum up to its nodes: what a method burns above it is the price of its shape. A single
polynomial before the cone (pseudospectral) cannot switch the thrust at once and overshoots between its nodes; the bound
is drawn in until the flown thrust keeps it.

### Initial positions

{_sweep(case)}

{pseudospectral_study(case)}"""


def _with_polyhedron(case: PlanCase) -> PlanCase:
    body = case.asteroid
    field = polyhedron_field(body.mesh.vertices, body.mesh.faces, body.gm_m3_s2)
    return replace(
        case, asteroid=Asteroid(body.name, body.mesh, body.rotation_rate_rad_s, field, body.gm_m3_s2)
    )


def _published_flight(case: PlanCase) -> tuple[Measured, float]:
    """Fly the curve of the printed guide points; its peak thrust, N, at stationary points."""
    start = (case.position_m, case.velocity_m_s, case.acceleration_m_s2)
    end = (case.site.position_m, case.landing_velocity_m_s, case.landing_acceleration_m_s2)
    first, last = first_control_points(7, case.tof_s, *start), last_control_points(7, case.tof_s, *end)
    guides = [R_AC_M, case.site.position_m + ALPHA_M * case.site.normal]
    leg = BezierLeg(case.tof_s, np.concatenate([first, guides, last]), case.asteroid.gravity)
    peak = peak_acceleration(leg, case.asteroid.rotation_rate_rad_s)[0]
    return measure(case, (leg,)), peak * case.spacecraft.mass_kg


def _at_published_points(case: PlanCase) -> str:
    point, peak = _published_flight(case)
    poly, poly_peak = _published_flight(_with_polyhedron(case))
    lighter = [
        _published_flight(replace(c, mass_model="variable"))[0] for c in (case, _with_polyhedron(case))
    ]
    rows = [
        ("peak thrust, N", "42.72", f"{peak:.3f}", f"{poly_peak:.3f}"),
        ("fuel, constant mass, kg", "26.56", f"{point.fuel_kg:.2f}", f"{poly.fuel_kg:.2f}"),
        ("fuel, variable mass, kg", "26.56", *(f"{one.fuel_kg:.2f}" for one in lighter)),
        (
            "least distance to a vertex before the cone, m",
            "334.54",
            *[f"{point.clearance_vertices_m:.1f}"] * 2,
        ),
        ("least distance to the surface before the cone, m", "-", *[f"{point.clearance_surface_m:.1f}"] * 2),
        ("angle 1 s before touchdown, degrees", "0.06", *[f"{point.landing_angle_deg:.3f}"] * 2),
    ]
    return table(("quantity", "paper", "point mass", "polyhedron"), rows)


def _times(case: PlanCase) -> str:
    vertices, rows = replace(case, clearance_metric="vertices"), []
    for tof_s, (thrust_n, fuel_kg) in PUBLISHED_TIMES.items():
        plan = plan_bezier(replace(vertices, tof_s=tof_s), BezierOptions())
        ours = f"{plan.peak_thrust_n:.2f}", f"{plan.fuel_kg:.2f}"
        rows.append((f"{tof_s:g} s, vertices", f"{thrust_n:.2f}", ours[0], f"{fuel_kg:.2f}", ours[1]))
    head = table(("time of flight, metric", "N, paper", "N, ours", "kg, paper", "kg, ours"), rows)
    shortest = []
    for one, printed in ((vertices, "1689.96"), (case, "-")):
        rule, plan = rule_time(one, BezierOptions()), plan_shortest_time(one, BezierOptions())
        shortest.append((one.clearance_metric, printed, f"{rule.tof_s:.2f}", f"{plan.tof_s:.2f}"))
    return head + "\n\n" + table(("shortest time, s: metric", "paper", "rule", "plan"), shortest)


def _methods(case: PlanCase) -> str:
    solvers: list[tuple[str, Callable[[], Plan]]] = [
        ("pseudospectral", lambda: plan_pseudospectral(case, PseudospectralOptions())),
        (
            "pseudospectral, eq 4",
            lambda: plan_pseudospectral(case, PseudospectralOptions(terminal="paper")),
        ),
        ("Bezier, guide points in their plane", lambda: plan_bezier(case, BezierOptions())),
        *((f"Bezier, degree {n}, free guide points", _free_guides(case, n)) for n in DEGREES),
        ("free control", lambda: plan_convex(case, ConvexOptions())),
        ("free control, eq 4", lambda: plan_convex(case, ConvexOptions(terminal="paper"))),
    ]
    rows: list[tuple[object, ...]] = [
        ("paper: pseudospectral", "26.39", "-", "-", "319.80", "3.00", "8.15"),
        ("paper: Bezier", "26.56", "42.72", "-", "334.54", "0.06", "0.13"),
    ]
    for name, solve in solvers:
        solve()
        began = time.thread_time()
        plan = solve()
        rows.append((name, *_figures(plan), f"{time.thread_time() - began:.2g}"))
    columns = ("method", "fuel, kg", "peak, N", "to surface, m", "to vertex, m", "angle, deg", "CPU, s")
    return table(columns, rows)


def _free_guides(case: PlanCase, degree: int) -> Callable[[], Plan]:
    return lambda: plan_bezier_free_guides(case, FreeGuidesOptions(degree=degree))


def _figures(plan: Plan) -> tuple[str, ...]:
    if plan.status != "planned":
        return plan.status, "-", "-", "-", "-"
    distances = f"{plan.clearance_surface_m:.1f}", f"{plan.clearance_vertices_m:.1f}"
    return f"{plan.fuel_kg:.2f}", f"{plan.peak_thrust_n:.2f}", *distances, f"{plan.landing_angle_deg:.2f}"


def _sweep(case: PlanCase) -> str:
    plans = [plan_bezier(c, BezierOptions()) for c in turned_cases(case, even_longitudes(LONGITUDES))]
    refused = [plan.parameters.get("refused_by") for plan in plans]
    planned, weak = refused.count(None), refused.count("thrust")
    failing = even_longitudes(LONGITUDES)[[one is not None for one in refused]]
    where = f", all between {failing.min():g} and {failing.max():g} degrees" if len(failing) else ""
    return f"""The paper lands from ten starts on its circle. Of {LONGITUDES} even longitudes, with the same time of flight,
{percent(planned + weak, LONGITUDES)} have guide points that keep terrain and cone, and {percent(planned, LONGITUDES)} within the thrust of {case.spacecraft.thrust_max_n:g} N.
Refused: {len(failing)}{where}."""
