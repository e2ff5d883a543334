"""Two reach runs side by side: facets and area gained and lost, what changed of margins, J and what binds."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import Mesh, facet_areas
from landing_cli.errors import InputRefused
from landing_cli.reach.records import Binding, Verdict
from landing_cli.reach.stored import CaseResult, ReachRun
from landing_cli.results.tables import Table, TableColumn, stacked
from landing_cli.results.tree import flag_words

Mask = NDArray[np.bool_]

_COST, _MARGIN = "performance_index_m2_s3", "thrust_margin"
# vertices of one surface about two origins differ by a shift, and by rounding, relative to its size
_SAME_SURFACE = 1e-9


@dataclass(frozen=True, eq=False)
class Shared:
    """The facets that both runs asked for in a case.

    Attributes
    ----------
    case : str
    facets : (n,) int
    before, after : (n,) structured arrays of FACET_DTYPE
    areas_m2 : (n,) float, m2
    """

    case: str
    facets: NDArray[np.int64]
    before: NDArray[np.void]
    after: NDArray[np.void]
    areas_m2: NDArray[np.float64]

    @property
    def was(self) -> Mask:
        """Reachable before, (n,) bool."""
        return np.asarray(self.before["verdict"] == Verdict.REACHABLE)

    @property
    def now(self) -> Mask:
        """Reachable after, (n,) bool."""
        return np.asarray(self.after["verdict"] == Verdict.REACHABLE)

    @property
    def j_change(self) -> NDArray[np.float64]:
        """Relative change of J, (n,); NaN where it is not reachable in both."""
        change = np.full(len(self.facets), np.nan)
        both = self.was & self.now
        change[both] = self.after[_COST][both] / self.before[_COST][both] - 1.0
        return change

    @property
    def margin_change(self) -> NDArray[np.float64]:
        """Change of the thrust margin, (n,); NaN where one of the runs has none."""
        return np.asarray(self.after[_MARGIN] - self.before[_MARGIN])


def compare_runs(before: ReachRun, after: ReachRun) -> list[dict[str, Any]]:
    """Compare the cases that two runs share.

    Parameters
    ----------
    before, after : ReachRun
        Over one surface.

    Returns
    -------
    list of dict
        One a shared case; see :func:`compare_cases`.

    Raises
    ------
    InputRefused
        The surfaces differ, or no case has the same name.
    """
    return [_compared(shared) for shared in shared_cases(before, after)]


def compare_cases(old: CaseResult, new: CaseResult) -> dict[str, Any]:
    """Compare two cases over one surface.

    Parameters
    ----------
    old, new : CaseResult
        The earlier and the later one.

    Returns
    -------
    dict
        ``case``; facets ``gained`` and ``lost`` (reachable in one run only) and their areas; verdicts
        ``changed`` in any way; the median and largest relative change of J where both are reachable; how many
        facets have a thrust margin in both, and the least, median and largest change of it; on how many
        facets of unchanged verdict another constraint binds.
    """
    return _compared(_shared(old, new))


def changed_facets(before: ReachRun, after: ReachRun) -> Table:
    """List the facets whose verdict or binding constraint changed.

    Parameters
    ----------
    before, after : ReachRun
        Over one surface.

    Returns
    -------
    Table
        A row a shared case and facet.

    Raises
    ------
    InputRefused
        As :func:`compare_runs`.
    """
    return stacked({shared.case: _changes(shared) for shared in shared_cases(before, after)})


def binding_changes(before: ReachRun, after: ReachRun) -> dict[str, dict[str, int]]:
    """Count what binds instead of what, on facets of unchanged verdict, by case: ``thrust -> ellipsoid``."""
    found = {}
    for shared in shared_cases(before, after):
        rows = np.flatnonzero(_binds_otherwise(shared))
        pairs = zip(shared.before["binding"][rows], shared.after["binding"][rows], strict=True)
        words = (f"{Binding(int(a)).name.lower()} -> {Binding(int(b)).name.lower()}" for a, b in pairs)
        found[shared.case] = dict(Counter(words).most_common())
    return found


def shared_cases(before: ReachRun, after: ReachRun) -> Iterator[Shared]:
    """Pair the cases that two runs share.

    Parameters
    ----------
    before, after : ReachRun
        Over one surface.

    Yields
    ------
    Shared
        In the later run's order.

    Raises
    ------
    InputRefused
        The surfaces differ, or no case has the same name.
    """
    refuse_other_surface(before.asteroid.mesh, after.asteroid.mesh)
    earlier = {case.case.name: case for case in before.cases}
    pairs = [(earlier[case.case.name], case) for case in after.cases if case.case.name in earlier]
    if not pairs:
        raise InputRefused("the runs have no case of the same name", fix="compare runs of one scenario")
    for old, new in pairs:
        yield _shared(old, new)


def refuse_other_surface(before: Mesh, after: Mesh) -> None:
    """Refuse to compare facets of different surfaces; the origin may differ.

    Parameters
    ----------
    before, after : Mesh
        Of the two runs.

    Raises
    ------
    InputRefused
        They differ in their number of facets, or facets of one number are different places.
    """
    sizes = [len(mesh.faces) for mesh in (before, after)]
    if sizes[0] != sizes[1]:
        raise InputRefused(
            f"the meshes have {sizes[0]} and {sizes[1]} facets", fix="compare runs over one shape"
        )
    same = len(before.vertices) == len(after.vertices) and bool((before.faces == after.faces).all())
    if same:
        a, b = (mesh.vertices - mesh.vertices.mean(axis=0) for mesh in (before, after))
        same = bool(np.abs(a - b).max() <= _SAME_SURFACE * np.abs(a).max())
    if not same:
        hashes = " and ".join(_mesh_hash(mesh)[:12] for mesh in (before, after))
        raise InputRefused(
            f"the meshes have {sizes[0]} facets each, but are different surfaces (sha256 {hashes}): a facet "
            "of one is another place on the other",
            fix="compare runs over one shape",
        )


def _mesh_hash(mesh: Mesh) -> str:
    return hashlib.sha256(mesh.vertices.tobytes() + mesh.faces.tobytes()).hexdigest()


def _shared(old: CaseResult, new: CaseResult) -> Shared:
    facets, rows_old, rows_new = np.intersect1d(
        old.solutions.rows["facet"], new.solutions.rows["facet"], return_indices=True
    )
    areas = facet_areas(new.case.asteroid.mesh)[facets]
    return Shared(new.case.name, facets, old.solutions.rows[rows_old], new.solutions.rows[rows_new], areas)


def _compared(shared: Shared) -> dict[str, Any]:
    gained, lost = shared.now & ~shared.was, shared.was & ~shared.now
    j_change = np.abs(shared.j_change[np.isfinite(shared.j_change)])
    margins = shared.margin_change[np.isfinite(shared.margin_change)]
    return {
        "case": shared.case,
        "gained": int(gained.sum()),
        "lost": int(lost.sum()),
        "changed": int((shared.before["verdict"] != shared.after["verdict"]).sum()),
        "area_gained_m2": float(shared.areas_m2[gained].sum()),
        "area_lost_m2": float(shared.areas_m2[lost].sum()),
        "j_change_median": float(np.median(j_change)) if j_change.size else None,
        "j_change_max": float(j_change.max()) if j_change.size else None,
        "margins_compared": len(margins),
        "margin_change_min": float(margins.min()) if margins.size else None,
        "margin_change_median": float(np.median(margins)) if margins.size else None,
        "margin_change_max": float(margins.max()) if margins.size else None,
        "binding_changed": int(_binds_otherwise(shared).sum()),
    }


def _binds_otherwise(shared: Shared) -> Mask:
    """Facets of unchanged verdict on which another constraint binds."""
    same = shared.before["verdict"] == shared.after["verdict"]
    return np.asarray(same & (shared.before["binding"] != shared.after["binding"]))


def _changes(shared: Shared) -> Table:
    other = (shared.before["verdict"] != shared.after["verdict"]) | _binds_otherwise(shared)
    rows = np.flatnonzero(other)
    was, now = shared.was[rows], shared.now[rows]
    verdicts = shared.before["verdict"][rows] != shared.after["verdict"][rows]
    kinds = np.select([now & ~was, was & ~now, verdicts], ["gained", "lost", "verdict"], "binding")
    columns = {"facet": TableColumn(shared.facets[rows].astype(np.int64)), "change": TableColumn(kinds)}
    for name, words in (("verdict", Verdict), ("binding", Binding)):
        for when, table in (("before", shared.before), ("after", shared.after)):
            columns[f"{name}_{when}"] = TableColumn(table[name][rows], flag_words(words))
    for when, table in (("before", shared.before), ("after", shared.after)):
        columns[f"{_COST}_{when}"] = TableColumn(table[_COST][rows])
        columns[f"{_MARGIN}_{when}"] = TableColumn(table[_MARGIN][rows])
    columns["area_m2"] = TableColumn(shared.areas_m2[rows])
    return Table(columns)
