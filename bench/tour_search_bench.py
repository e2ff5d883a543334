"""CPU time of the beam search over the reference catalogue, and how it grows with targets and beam.

Run ``python -m bench tour-search [beam ...]``: needs the catalogue in LANDING_REFERENCE_DATA/catalog (default
../shared/catalog) and the extra ``tour``. Every search is the whole one: N-body flights of all targets, the
first leg in N-body, all levels; the re-flight is not part of it.
"""

from __future__ import annotations

import math
import os
import sys
import time
from pathlib import Path

import numpy as np

from landing_cli.flight.astronomy import AU_M, DAY_S
from landing_cli.sources.catalogue_files import read_catalogue
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.beam_search import search
from landing_cli.tour.departure import departure_from_polar
from landing_cli.tour.ephemeris import flight_ephemeris
from landing_cli.tour.records import BeamOptions, DepthReport, SearchLimits, TargetLimits
from landing_cli.tour.targets import select
from landing_cli.tour.time_scales import utc_to_t_s

BEAMS = (50, 100, 200)
ROOT = Path(__file__).resolve().parent.parent


def main() -> None:
    """Print the table."""
    folder = Path(os.environ.get("LANDING_REFERENCE_DATA", ROOT.parent / "shared")) / "catalog"
    begun = time.process_time()
    read = read_catalogue(folder / "NEA_2019.txt.gz")
    print(f"catalogue: {len(read)} rows read in {time.process_time() - begun:.2f} s of CPU")
    targets = select(read, TargetLimits(1.2 * AU_M, math.inf, None, False, (), 0.15))
    beams = [int(word) for word in sys.argv[1:]] or list(BEAMS)
    timed(targets.take(np.arange(0, len(targets), 100)), 5, told=False)  # compiles
    row(targets.take(np.arange(0, len(targets), 4)), beams[-1])
    row(targets.take(np.arange(0, len(targets), 2)), beams[-1])
    for beam in beams:
        row(targets, beam)


def row(targets: Catalogue, beam: int) -> None:
    """Search once and print a line."""
    cpu_s, told = timed(targets, beam)
    print(f"  {len(targets):6d} targets, beam {beam:5d}: {cpu_s:7.1f} s of CPU; {told}", flush=True)


def timed(targets: Catalogue, beam: int, told: bool = True) -> tuple[float, str]:
    """CPU time of a search on one thread, and what it found."""
    start, end = utc_to_t_s("2021-04-08T15:36:00"), utc_to_t_s("2022-12-31T00:00:00")
    ephemeris = flight_ephemeris("de440", min(start, float(targets.elements.epoch_t_s.min())), end)
    departure = departure_from_polar(start, 1.5e9, math.radians(202.2), 432.0, ephemeris)
    limits = SearchLimits(660.0, end, math.inf, 8, 1, 30.0 * DAY_S)
    options = BeamOptions(beam, 4.0 * DAY_S, (0.0, 30.0 * DAY_S), 15, 40)
    reports: list[DepthReport] = []
    begun = time.process_time()
    search(targets, departure, limits, options, ephemeris, progress=reports.append)
    spent = time.process_time() - begun
    best = [f"{r.asteroids}: {r.least_delta_v_m_s:.0f}" for r in reports if r.kept]
    return spent, "asteroids: least m/s " + ", ".join(best) if told else ""


if __name__ == "__main__":
    main()
