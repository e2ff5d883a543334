"""Tours made by hand: chains that fly in N-body from a departure near the Earth, without any search."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from landing_cli.flight.astronomy import AU_M, DAY_S
from landing_cli.flight.elements import OrbitElements
from landing_cli.results.identity import RunIdentity
from landing_cli.results.store import write
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.escape_records import EscapeFlight, EscapeMap, EscapeRun
from landing_cli.tour.records import Departure, DepthReport, Flyby, FlybyChain, Leg, SearchLimits
from landing_cli.tour.run_records import (
    ChainEntry,
    ChainPath,
    PrintedDay,
    SchemeModel,
    TourFacts,
    TourRun,
)
from landing_cli.tour.stored import run_to_tree

START_S = 6.71e8
SCENARIO = """\
name: probe
tour:
  departure: {epoch_utc: 2021-04-08T15:36:00, distance_km: 1.5e6, sun_angle_deg: 202.2, radial_speed_m_s: 432}
  targets: {exclude: [2014 NQ64]}
  limits: {delta_v_m_s: 660, end_utc: 2023-01-01}
"""


def write_scenario(folder: Path, text: str = SCENARIO) -> Path:
    path = folder / "probe.yaml"
    path.write_text(text)
    return path


def targets() -> Catalogue:
    elements = OrbitElements(
        epoch_t_s=np.array([START_S, START_S]),
        a_m=np.array([1.2, 1.6]) * AU_M,
        e=np.array([0.2, 0.4]),
        inclination_rad=np.array([0.02, 0.1]),
        node_rad=np.array([1.0, 2.0]),
        argument_rad=np.array([0.5, 3.0]),
        mean_anomaly_rad=np.array([0.1, 4.0]),
    )
    return Catalogue(
        ("12923", "2018 QE"),
        elements,
        np.array([15.75, 27.7]),
        np.array([0, -1]),
        np.array([True, False]),
        "sample.txt",
        "0" * 64,
        (),
    )


def chain(shift: float = 0.0, status: str = "flown") -> FlybyChain:
    """Two flybys; `shift` makes it dearer."""
    hints = tuple(
        Leg(row, name, START_S + (100.0 * row + 5.0) * DAY_S, START_S + 100.0 * (row + 1) * DAY_S, burn, row)
        for row, name, burn in (
            (0, "12923", np.array([100.0 + shift, 20.0, 3.0])),
            (1, "2018 QE", np.array([-30.0, 40.0, 0.0])),
        )
    )
    flybys = tuple(
        Flyby(
            leg.designation,
            leg.arrival_t_s,
            np.array([1.1e11, -1.2e11, 1e9]),
            np.array([3000.0, 4000.0, 0.0]),
            0.7,
            3e10,
            (15.75, 27.7)[leg.target],
            (2429.43, 9.89)[leg.target],
            18.0,
            12.0,
        )
        for leg in hints
    )
    message = "" if status == "flown" else "the first leg passes the Moon"
    return FlybyChain(START_S, hints, hints if status == "flown" else None, flybys, status, message)  # type: ignore[arg-type]


def path() -> ChainPath:
    t_s = START_S + np.linspace(0.0, 200.0, 21) * DAY_S
    angle = np.linspace(0.0, 3.4, 21)
    circle = AU_M * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(21)])
    return ChainPath(t_s, 1.05 * circle, circle / 5e6, circle, np.repeat([0, 1, 2], 7))


def facts(kind: str = "search") -> TourFacts:
    departure = Departure(
        START_S, np.array([1.5e11, 1e9, 0.0]), np.array([0.0, 3e4, 10.0]), 1.5e9, 3.529, 432.0
    )
    limits = SearchLimits(660.0, START_S + 600 * DAY_S, np.inf, 5, 1, 30 * DAY_S)
    return TourFacts("probe", kind, "beam", departure, limits, 0.15, "DE440", targets(), 30, 2, 2)  # type: ignore[arg-type]


def tour_run(kind: str = "search") -> TourRun:
    told = facts(kind)
    if kind == "compare":
        model = SchemeModel(np.array([295.0, 80.0]), np.array([298.0, 71.0]))
        days = (PrintedDay(2, "2018 QE", 1.43e10, 1.46e10), PrintedDay(1, "12923", 3.26e10, 3.27e10))
        entries = (ChainEntry("scheme_02", chain(), path(), told, model),)
        return TourRun(entries, told, (), None, days=days)
    entries = tuple(
        ChainEntry(f"chain_{i + 1:02d}", chain(shift), path(), told) for i, shift in enumerate((0.0, 50.0))
    )
    depths = (DepthReport(1, 2000, 40, 20, 55.5), DepthReport(2, 900, 3, 2, 151.5))
    return TourRun(entries, told, depths, None, (chain(10.0, "broken"),))


def escape_run() -> EscapeRun:
    low, high = np.linspace(1e5, 5e6, 4), np.linspace(1e5, 6.6e7, 5)
    gm, radius = 4.9028e12, 1.7374e6
    a, b = radius + low[:, None], radius + high[None]
    increment = np.sqrt(2 * gm / a) * (1 - np.sqrt(b / (a + b)))
    entry = EscapeMap("moon", gm, radius, low, high, np.where(b >= a, increment, np.nan))
    return EscapeRun(
        (entry,),
        (EscapeFlight("perigee_100_km", 1e5, 1.5e9, 23.8, 20.0, 40.0, 30.0, 50.0, 1.4e9, "to 1.5e6 km"),),
    )


def write_run(file: Path, run: TourRun | EscapeRun, scenario: str = SCENARIO) -> Path:
    kind = "escape" if isinstance(run, EscapeRun) else run.facts.kind
    identity = RunIdentity(f"tour {kind}", scenario, "0" * 64, "0.1.0")
    write(file, run_to_tree(run), {"mission": "tour", "complete": 1, **identity.as_dict()}, {})
    return file
