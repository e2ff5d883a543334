"""Whether a list of triangles is the surface of one body: each check names what fails, and the fix."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from landing_cli.body import surface_topology as topology
from landing_cli.body.mesh import FloatArray, IntArray, Mesh
from landing_cli.body.outward_support import support_areas
from landing_cli.errors import InputRefused

LEAST_EXTENT_M = 10.0
GREATEST_EXTENT_M = 400e3

# A facet thinner than this share of its longest edge has no normal worth the name.
_LEAST_HEIGHT_RATIO = 1e-9


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles as they were read, before anything is known about them.

    Attributes
    ----------
    vertices_m : (n, 3) float, m
        Positions; may hold anything.
    faces : (m, 3) int
        0-based vertex indices; may be out of range.
    vertex_lines, facet_lines : (n,) and (m,) int, optional
        Line of the file (from 1) that each came from.
    """

    vertices_m: FloatArray
    faces: IntArray
    vertex_lines: IntArray | None = None
    facet_lines: IntArray | None = None

    def vertex(self, index: int) -> str:
        """Name a vertex for a message."""
        return _named("vertex", index, self.vertex_lines)

    def facet(self, index: int) -> str:
        """Name a facet for a message."""
        return _named("facet", index, self.facet_lines)


def _named(noun: str, index: int, lines: IntArray | None) -> str:
    if lines is not None and 0 <= index < len(lines):
        return f"{noun} {index} (line {lines[index]})"
    return f"{noun} {index}"


@dataclass(frozen=True)
class Fault:
    """What a check found: the part at fault, what is wrong with it, and what to do."""

    where: str
    what: str
    fix: str


@dataclass(frozen=True)
class CheckResult:
    """One line of the report.

    Attributes
    ----------
    name : str
        What should hold.
    status : {"passed", "failed", "not reached"}
        Not reached: an earlier failure leaves the question without meaning.
    fault : Fault or None
        Given when the check failed.
    """

    name: str
    status: Literal["passed", "failed", "not reached"]
    fault: Fault | None = None


def _is_large_enough(surface: Surface) -> Fault | None:
    found = f"{len(surface.vertices_m)} vertices and {len(surface.faces)} facets"
    if len(surface.vertices_m) >= 4 and len(surface.faces) >= 4:
        return None
    return Fault("", f"{found}; a closed body needs at least 4 of each", "is the file empty or cut short?")


def _is_finite(surface: Surface) -> Fault | None:
    bad = np.flatnonzero(~np.isfinite(surface.vertices_m).all(axis=1))
    if not len(bad):
        return None
    found = surface.vertices_m[bad[0]].tolist()
    return Fault(surface.vertex(bad[0]), f"position {found} is not finite", "correct the number")


def _is_in_range(surface: Surface) -> Fault | None:
    count = len(surface.vertices_m)
    bad = np.flatnonzero(((surface.faces < 0) | (surface.faces >= count)).any(axis=1))
    if not len(bad):
        return None
    corners = surface.faces[bad[0]].tolist()
    return Fault(
        surface.facet(bad[0]),
        f"0-based corners {corners} do not all lie in 0..{count - 1}",
        "is the file complete, and does it count vertices from 0 or from 1 as stated (--index-base)?",
    )


def _is_plausible(surface: Surface) -> Fault | None:
    extent = float(np.ptp(surface.vertices_m, axis=0).max())
    if LEAST_EXTENT_M <= extent <= GREATEST_EXTENT_M:
        return None
    unit = "km" if extent < LEAST_EXTENT_M else "m"
    return Fault(
        "",
        f"the body is {extent:.4g} m across; small bodies have {LEAST_EXTENT_M:g} m to "
        f"{GREATEST_EXTENT_M / 1e3:g} km",
        f"are the coordinates in {unit}? State the length unit of the file",
    )


def _has_no_degenerate_facet(surface: Surface) -> Fault | None:
    repeated = topology.facets_with_repeated_corner(surface.faces)
    if len(repeated):
        corners = surface.faces[repeated[0]].tolist()
        return Fault(surface.facet(repeated[0]), f"names a vertex twice: {corners}", "remove the facet")
    corners_m = surface.vertices_m[surface.faces]
    sides = np.roll(corners_m, -1, axis=1) - corners_m
    longest = (sides**2).sum(axis=2).max(axis=1)
    doubled_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    flat = np.flatnonzero(~(doubled_area > _LEAST_HEIGHT_RATIO * longest))
    if not len(flat):
        return None
    return Fault(
        surface.facet(flat[0]),
        f"has no area: its corners {surface.faces[flat[0]].tolist()} lie on a line or coincide",
        "merge vertices that coincide and re-triangulate there",
    )


def _has_no_duplicate_facet(surface: Surface) -> Fault | None:
    pair = topology.duplicate_facets(surface.faces)
    if pair is None:
        return None
    first, second = pair
    return Fault(surface.facet(second), f"repeats {surface.facet(first)}", "remove one of the two")


def _uses_every_vertex(surface: Surface) -> Fault | None:
    used = np.zeros(len(surface.vertices_m), dtype=bool)
    used[surface.faces] = True
    idle = np.flatnonzero(~used)
    if not len(idle):
        return None
    return Fault(
        surface.vertex(idle[0]),
        f"belongs to no facet ({len(idle)} such vertices)",
        "remove it; if it is the first or the last, look whether the facets count from 0 or from 1",
    )


def _has_each_directed_edge_once(surface: Surface) -> Fault | None:
    found = topology.repeated_directed_edge(surface.faces)
    if found is None:
        return None
    a, b, facets = found
    names = " and ".join(surface.facet(f) for f in facets[:2])
    where = f"edge from {surface.vertex(a)} to {surface.vertex(b)}"
    if topology.facets_at_edge(surface.faces, a, b) > 2:
        return Fault(where, f"more than two facets meet, among them {names}", "remove the inner facets")
    return Fault(where, f"{names} are wound in opposite senses", "reverse the corners of one of them")


def _is_closed(surface: Surface) -> Fault | None:
    found = topology.open_edges(surface.faces)
    if not len(found):
        return None
    a, b, facet = found[0]
    return Fault(
        f"edge from {surface.vertex(a)} to {surface.vertex(b)}",
        f"the surface is open here: only {surface.facet(facet)} has this edge ({len(found)} such edges)",
        "fill the hole, or merge vertices that coincide along a seam",
    )


def _is_one_body(surface: Surface) -> Fault | None:
    pinched = topology.pinched_vertex(surface.faces, len(surface.vertices_m))
    if pinched is not None:
        return Fault(
            surface.vertex(pinched), "two parts of the surface touch in this vertex alone", "split the vertex"
        )
    labels = topology.bodies(surface.faces, len(surface.vertices_m))
    if not labels.any():
        return None
    sizes = np.bincount(labels)
    other = int(np.flatnonzero(labels == 1)[0])
    return Fault(
        surface.facet(other),
        f"is not connected to facet 0: {len(sizes)} separate surfaces of {sizes.tolist()[:5]} facets",
        "keep one body per file, without inner surfaces",
    )


def _is_solid(surface: Surface) -> Fault | None:
    spread = np.linalg.svd(surface.vertices_m - surface.vertices_m.mean(axis=0), compute_uv=False)
    if spread[2] > 1e-6 * spread[0]:
        return None
    return Fault("", "all vertices lie in one plane: the body is flat", "is a coordinate column missing?")


def _faces_outwards(surface: Surface) -> Fault | None:
    extreme, areas = support_areas(surface.vertices_m, surface.faces)
    bad = extreme[areas <= 0.0]
    if not len(bad):
        return None
    if len(bad) == len(extreme):
        return Fault("", "every facet is wound inwards", "reverse the order of the corners of every facet")
    return Fault(
        surface.vertex(bad[0]),
        f"is an outermost point, but its facets face inwards ({len(bad)} of {len(extreme)} such points)",
        "the facets name the wrong vertices: a table that counts from 0 was read as counting from 1, "
        "or the reverse (--index-base)",
    )


def _has_volume(surface: Surface) -> Fault | None:
    volume = _volume(surface)
    if volume > 0.0:
        return None
    return Fault("", f"the volume is {volume:.4g} m3", "the surface crosses itself: mend it in a mesh editor")


def _volume(surface: Surface) -> float:
    a, b, c = np.moveaxis(surface.vertices_m[surface.faces] - surface.vertices_m.mean(axis=0), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


# A stage runs when the stages before it have passed.
_Check = tuple[str, Callable[[Surface], Fault | None]]
_STAGES: tuple[tuple[_Check, ...], ...] = (
    (
        ("at least 4 vertices and 4 facets", _is_large_enough),
        ("every position finite", _is_finite),
        ("every corner in range", _is_in_range),
    ),
    (
        ("extent plausible for the length unit", _is_plausible),
        ("no degenerate facet", _has_no_degenerate_facet),
        ("no duplicate facet", _has_no_duplicate_facet),
        ("every vertex used", _uses_every_vertex),
    ),
    (("each directed edge once", _has_each_directed_edge_once), ("closed", _is_closed)),
    (("one body", _is_one_body), ("not flat", _is_solid)),
    (("outward winding and support", _faces_outwards),),
    (("positive volume", _has_volume),),
)


def check_surface(surface: Surface) -> Iterator[CheckResult]:
    """Run every check, as far as the earlier ones leave it a meaning.

    Parameters
    ----------
    surface : Surface
        Triangles as they were read.

    Yields
    ------
    CheckResult
        In a fixed order, one for each check.
    """
    blocked = False
    for stage in _STAGES:
        failed = False
        for name, check in stage:
            fault = None if blocked else check(surface)
            failed |= fault is not None
            status: Literal["passed", "failed", "not reached"]
            status = "not reached" if blocked else "failed" if fault else "passed"
            yield CheckResult(name, status, fault)
        blocked |= failed


def checked_mesh(surface: Surface, *, source: str = "") -> Mesh:
    """Turn triangles into a mesh, or refuse them.

    Parameters
    ----------
    surface : Surface
        Triangles as they were read.
    source : str, optional
        Where they came from, for the message.

    Returns
    -------
    Mesh
        One closed body, wound outwards, in m.

    Raises
    ------
    InputRefused
        At the first check that fails, with the facet, edge or vertex at fault.
    """
    for result in check_surface(surface):
        if result.fault is not None:
            where = ", ".join(part for part in (source, result.fault.where) if part)
            raise InputRefused(result.fault.what, where=where, fix=result.fault.fix)
    return Mesh(surface.vertices_m, surface.faces)
