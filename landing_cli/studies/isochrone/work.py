"""Facets of all initial states at all times of flight as one list of work.

An item is one facet at one place of the ladder from one initial state, written as one integer, so that a
chunk of work is an array that can be cut anywhere. A chunk in ascending order holds the facets of a case
together: each case is prepared once a chunk, which costs as much as one or two facets. The facets whose
verdict changes in the same step are halved in one chunk, where they share the cases of the first halvings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.facet_work import solve_items as solve_facets, solve_without_proofs
from landing_cli.reach.free_descent import Surroundings, prepare
from landing_cli.reach.records import FacetSolutions, LandingCase
from landing_cli.studies.isochrone.halving import Brackets, halves, middles, wide
from landing_cli.studies.isochrone.records import SAMPLE_DTYPE, Rows
from landing_cli.studies.isochrone.time_grid import TimeGrid

Items = NDArray[np.int64]

# A change of verdict to look into: the item at the beginning of its step, and the verdicts at both ends.
CHANGE_DTYPE = np.dtype([("item", "i8"), ("before", "u1"), ("after", "u1")])
CHUNK_CHANGES = 64

_TAKEN = ("verdict", "proved", "performance_index_m2_s3", "delta_v_m_s")


@dataclass(frozen=True, eq=False)
class Study:
    """Everything that an answer depends on; it pickles.

    Attributes
    ----------
    cases : tuple of LandingCase
        One an initial state; their time of flight is replaced.
    grid : TimeGrid
    shared : Surroundings
        What all cases over the asteroid and ellipsoid share.
    """

    cases: tuple[LandingCase, ...]
    grid: TimeGrid
    shared: Surroundings

    @property
    def facets(self) -> int:
        """Facets of the mesh."""
        return len(self.shared.centroids_m)

    def items(
        self, state: NDArray[np.integer], place: NDArray[np.integer], facet: NDArray[np.integer]
    ) -> Items:
        """Write questions as items, ascending where state, place and facet do."""
        return (np.asarray(state, dtype=np.int64) * self.grid.places + place) * self.facets + facet

    def parted(self, items: Items) -> tuple[Items, Items, Items]:
        """State, place and facet of items."""
        cases, facet = np.divmod(items, self.facets)
        state, place = np.divmod(cases, self.grid.places)
        return state, place, facet

    @property
    def grid_items(self) -> Items:
        """Every facet of every state at every time of the grid, ascending."""
        state = np.arange(len(self.cases))[:, None, None]
        return self.items(state, self.grid.on_grid[:, None], np.arange(self.facets)).reshape(-1)


def case_at(case: LandingCase, tof_s: float) -> LandingCase:
    """Return the case of `reach run` for one time of flight, under its name there."""
    return replace(case, name=f"{case.name}_{tof_s:.12g}s", tof_s=float(tof_s))


def solve_at(study: Study, state: int, tof_s: float, facets: Items, prove: bool = True) -> FacetSolutions:
    """Solve facets at one time of flight, as `reach run` does.

    Parameters
    ----------
    study : Study
        The study.
    state : int
        Index of the initial state.
    tof_s : float, s
        Time of flight.
    facets : (k,) int
        Facets, 0-based.
    prove : bool
        As for :func:`solve_items`.

    Returns
    -------
    FacetSolutions
        In ascending facet order.
    """
    prepared = prepare(case_at(study.cases[state], tof_s), study.shared)
    if not prove:
        return solve_without_proofs(prepared, facets)
    return solve_facets((prepared,), study.facets, facets)


def solve_items(study: Study, items: Items, prove: bool = True) -> Rows:
    """Solve a chunk of items.

    Parameters
    ----------
    study : Study
        The study.
    items : (k,) int
        What to solve.
    prove : bool
        Whether what the ellipsoid stops is to be proved unreachable; no verdict depends on it.

    Returns
    -------
    (k,) structured array of SAMPLE_DTYPE
        Ascending.
    """
    ordered = np.sort(np.asarray(items, dtype=np.int64))
    rows = np.zeros(len(ordered), dtype=SAMPLE_DTYPE)
    rows["item"] = ordered
    state, place, facet = study.parted(ordered)
    begins = np.flatnonzero(np.diff(ordered // study.facets, prepend=-1))
    for begin, end in zip(begins, [*begins[1:], len(ordered)], strict=True):
        tof_s = float(study.grid.times_s(place[begin]))
        solved = solve_at(study, int(state[begin]), tof_s, facet[begin:end], prove).rows
        for name in _TAKEN:
            rows[name][begin:end] = solved[name]
    return rows


def step_of(study: Study, items: Items) -> Items:
    """Return the items at the beginning of the steps that items lie in."""
    state, place, facet = study.parted(items)
    return study.items(state, place - place % study.grid.parts, facet)


def halve_changes(study: Study, changes: Rows) -> Rows:
    """Find where in their steps verdicts change.

    Parameters
    ----------
    study : Study
        The study; its grid has halvings.
    changes : (k,) structured array of CHANGE_DTYPE
        Which steps.

    Returns
    -------
    structured array of SAMPLE_DTYPE
        What was asked, each once, ascending.
    """
    state, low, facet = study.parted(changes["item"])
    series = state * study.facets + facet
    brackets = Brackets(series, low, low + study.grid.parts, changes["before"], changes["after"])
    found = [np.zeros(0, dtype=SAMPLE_DTYPE)]
    while len((brackets := brackets.taken(wide(brackets))).series):
        state, facet = np.divmod(brackets.series, study.facets)
        items = study.items(state, middles(brackets), facet)
        found.append(solve_items(study, items, prove=False))
        verdicts = np.empty(len(items), dtype=np.uint8)
        verdicts[np.argsort(items)] = found[-1]["verdict"]
        brackets = halves(brackets, verdicts)
    rows = np.concatenate(found)
    return rows[np.argsort(rows["item"])]


def changes_of(study: Study, samples: Rows) -> list[Rows]:
    """List the steps in which a verdict changes, in chunks of steps that share their cases.

    Parameters
    ----------
    study : Study
        The study.
    samples : structured array of SAMPLE_DTYPE
        Every item of the grid, ascending.

    Returns
    -------
    list of structured arrays of CHANGE_DTYPE
        Each of one initial state and one step, ascending.
    """
    shape = (len(study.cases), len(study.grid.tof_s), study.facets)
    verdict, item = samples["verdict"].reshape(shape), samples["item"].reshape(shape)
    changed = verdict[:, :-1] != verdict[:, 1:]
    chunks = []
    for state, step in np.argwhere(changed.any(axis=2)).tolist():
        facet = np.flatnonzero(changed[state, step])
        rows = np.zeros(len(facet), dtype=CHANGE_DTYPE)
        rows["item"] = item[state, step, facet]
        rows["before"], rows["after"] = verdict[state, step, facet], verdict[state, step + 1, facet]
        chunks += [rows[i : i + CHUNK_CHANGES] for i in range(0, len(rows), CHUNK_CHANGES)]
    return chunks


def ask(study: Study, questions: Rows) -> Rows:
    """Solve questions of the grid: rows with a field ``item``; see `solve_items`."""
    return solve_items(study, questions["item"])


def blank_samples(items: Items) -> Rows:
    """Answers to items that were lost: unresolved."""
    rows = np.zeros(len(items), dtype=SAMPLE_DTYPE)
    rows["item"] = items
    rows["performance_index_m2_s3"] = rows["delta_v_m_s"] = np.nan
    return rows
