"""A departure, the paper's targets and small search spaces for the tests of the search."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from landing_cli.flight.astronomy import AU_M, DAY_S
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.beam import SearchSpace
from landing_cli.tour.beam_search import search_space, serial
from landing_cli.tour.departure import departure_from_polar
from landing_cli.tour.ephemeris import Ephemeris, flight_ephemeris
from landing_cli.tour.records import BeamOptions, Departure, SearchLimits, TargetLimits
from landing_cli.tour.targets import embedded_catalogue, select
from landing_cli.tour.time_scales import utc_to_t_s

START_T_S = utc_to_t_s("2021-04-08T15:36:00")
END_T_S = utc_to_t_s("2022-12-31T00:00:00")
LIMITS = SearchLimits(660.0, END_T_S, math.inf, 6, 1, 0.0)
OPTIONS = BeamOptions(beam=60, time_step_s=4.0 * DAY_S, waits_s=(0.0,), branches=9, kept_chains=20)


@cache
def nine() -> Catalogue:
    """Table 2's targets without the one whose orbit is not known."""
    return select(embedded_catalogue(), TargetLimits(1.2 * AU_M, math.inf, None, False, ("2014 NQ64",), 0.15))


@cache
def ephemeris() -> Ephemeris:
    return flight_ephemeris("de440", float(nine().elements.epoch_t_s.min()), END_T_S)


@cache
def departure() -> Departure:
    """The start that was inferred for the paper."""
    return departure_from_polar(START_T_S, 1.5e9, math.radians(202.2), 432.0, ephemeris())


@cache
def space() -> SearchSpace:
    return search_space(nine(), departure(), LIMITS, OPTIONS, ephemeris(), serial)


def row_of(designation: str) -> int:
    return nine().designations.index(designation)


def norms(rows: np.ndarray) -> np.ndarray:
    return np.linalg.norm(rows, axis=-1)
