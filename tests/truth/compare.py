"""Print how the package agrees with the tables: in tests/, ``python -m truth.compare [table ...]``."""

from __future__ import annotations

import sys

import numpy as np

from landing_cli.reach.free_descent import solve_facets
from landing_cli.reach.records import Verdict
from truth.tables import HERE, landing_case, read_table

TAU_BAND = 5e-4  # verdicts are judged beyond this distance from tau = 1


def compare(name: str) -> None:
    """One line a case, and one for every facet that disagrees."""
    for truth in read_table(name):
        case, facets = landing_case(truth)
        rows = solve_facets(case, facets).rows
        verdict, known = rows["verdict"], np.isfinite(truth.tau) & (np.abs(truth.tau - 1) > TAU_BAND)
        lost = known & (truth.tau < 1) & (verdict != Verdict.REACHABLE)
        invented = known & (truth.tau > 1) & (verdict == Verdict.REACHABLE)
        excess = rows["performance_index_m2_s3"] / truth.j - 1
        level = (1 - rows["thrust_margin"]) - truth.tau
        beyond = known & (truth.tau > 1)
        print(
            f"{name} {truth.name}: {len(facets)} facets ({truth.ellipsoid_binds.sum()} ellipsoid), "
            f"lost {lost.sum()}, invented {invented.sum()}, "
            f"proved {(rows['proved'][beyond] == 1).sum()} of {beyond.sum()}, "
            f"J {spread(excess)}, tau {spread(level)}"
        )
        for k in np.flatnonzero(lost | invented | (np.abs(excess) > 3e-3)):
            print(
                f"    facet {truth.facets[k]}: {Verdict(verdict[k]).name.lower()}, tau {truth.tau[k]:.5f}, "
                f"J {excess[k]:+.1e}, ellipsoid binds {truth.ellipsoid_binds[k]}"
            )


def spread(values: np.ndarray) -> str:
    """Least, median and greatest of the finite values."""
    values = values[np.isfinite(values)]
    if not len(values):
        return "none"
    return f"{values.min():+.1e} {np.median(values):+.1e} {values.max():+.1e}"


if __name__ == "__main__":
    for wanted in sys.argv[1:] or sorted(path.stem for path in HERE.glob("*.csv")):
        compare(wanted)
