"""Each check names the part at fault, and sound surfaces pass all of them."""

from __future__ import annotations

import numpy as np
import pytest
from shape_helpers import box, fibonacci_ellipsoid, tetrahedron

from landing_cli.body.mesh import Mesh
from landing_cli.body.mesh_checks import Surface, check_surface, checked_mesh
from landing_cli.errors import InputRefused


def ball() -> Mesh:
    return fibonacci_ellipsoid((300.0, 200.0, 150.0), 60)


def faults(vertices, faces) -> dict[str, str]:
    results = check_surface(Surface(np.asarray(vertices), np.asarray(faces)))
    return {r.name: f"{r.fault.where}: {r.fault.what}; {r.fault.fix}" for r in results if r.fault}


def torus(rings: int = 12, around: int = 8) -> Mesh:
    u, v = np.meshgrid(
        2 * np.pi * np.arange(rings) / rings, 2 * np.pi * np.arange(around) / around, indexing="ij"
    )
    r = 300 + 100 * np.cos(v)
    points = np.stack([r * np.cos(u), r * np.sin(u), 100 * np.sin(v)], axis=-1).reshape(-1, 3)
    a = np.arange(rings * around).reshape(rings, around)
    b, c, d = np.roll(a, -1, 0), np.roll(np.roll(a, -1, 0), -1, 1), np.roll(a, -1, 1)
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return Mesh(points, faces)


@pytest.mark.parametrize(
    "mesh", [ball(), box((100.0, 200.0, 300.0)), tetrahedron(50.0), torus(), box((1e4, 20.0, 10.0))]
)
def test_sound_surfaces_pass_every_check(mesh):
    assert all(r.status == "passed" for r in check_surface(Surface(mesh.vertices, mesh.faces)))
    np.testing.assert_array_equal(checked_mesh(Surface(mesh.vertices, mesh.faces)).faces, mesh.faces)


def test_a_dented_but_sound_body_passes():
    mesh = fibonacci_ellipsoid((300.0, 200.0, 150.0), 500)
    vertices = mesh.vertices.copy()
    vertices[250] *= 0.1
    assert not faults(vertices, mesh.faces)


def broken_cases():
    v, f = ball().vertices.copy(), ball().faces.copy()
    yield (
        "at least 4 vertices and 4 facets",
        "0 vertices and 0 facets",
        np.zeros((0, 3)),
        np.zeros((0, 3), int),
    )
    yield "at least 4 vertices and 4 facets", "60 vertices and 0 facets", v, np.zeros((0, 3), int)
    bad = v.copy()
    bad[7, 1] = np.nan
    yield "every position finite", "vertex 7: position ", bad, f
    bad = v.copy()
    bad[9, 2] = np.inf
    yield "every position finite", "vertex 9", bad, f
    for wrong in (-1, 60):
        bad = f.copy()
        bad[5, 0] = wrong
        yield "every corner in range", f"facet 5: 0-based corners {bad[5].tolist()}", v, bad
    bad = f.copy()
    bad[3, 1] = bad[3, 0]
    yield "no degenerate facet", "facet 3: names a vertex twice", v, bad
    bad = v.copy()
    a, b, c = f[11]
    bad[c] = 0.5 * (bad[a] + bad[b])
    yield "no degenerate facet", f"facet 11: has no area: its corners {f[11].tolist()}", bad, f
    yield "no duplicate facet", "facet 116: repeats facet 4", v, np.vstack([f, np.roll(f[4], 1)])
    yield "no duplicate facet", "facet 116: repeats facet 4", v, np.vstack([f, f[4][::-1]])
    yield "every vertex used", "vertex 60: belongs to no facet (1 such", np.vstack([v, v[:1] + 1.0]), f
    bad = f.copy()
    bad[8] = bad[8][::-1]
    yield "each directed edge once", "wound in opposite senses; reverse the corners", v, bad
    extra = [f[0, 0], f[0, 1], int(np.setdiff1d(np.arange(60), f[(f == f[0, 0]).any(axis=1)]).min())]
    yield (
        "each directed edge once",
        "more than two facets meet, among them facet 0 and facet 116",
        v,
        [*f, extra],
    )
    yield "closed", "the surface is open here: only facet", v, f[1:]
    two = np.vstack([f, f + 60])
    yield "one body", "facet 116: is not connected to facet 0: 2 separate", np.vstack([v, v + 1000.0]), two
    hollow = np.vstack([f, f[:, ::-1] + 60])
    yield "one body", "facet 116: is not connected to facet 0", np.vstack([v, 0.5 * v]), hollow
    far = v - v[0] * 2.0
    far_faces = np.where(f == 0, 0, f + 59)
    pinched = np.vstack([v, -far[1:] + 0.0])
    yield "one body", "touch in this vertex alone", pinched, np.vstack([f, far_faces[:, ::-1]])
    flat = v * [1.0, 1.0, 0.0]
    yield "not flat", "all vertices lie in one plane", flat, f
    yield "outward winding and support", "every facet is wound inwards; reverse", v, f[:, ::-1]
    for shift in (-1, 1):
        yield "outward winding and support", "the facets name the wrong vertices", v, (f + shift) % 60
    yield "extent plausible for the length unit", "0.5925 m across", v * 1e-3, f
    yield "extent plausible for the length unit", "are the coordinates in m?", v * 1e3, f


CASES = list(broken_cases())


@pytest.mark.parametrize(
    ("check", "words", "vertices", "faces"), CASES, ids=[c[0] + "|" + c[1] for c in CASES]
)
def test_a_broken_surface_fails_the_check_that_names_its_fault(check, words, vertices, faces):
    found = faults(vertices, faces)
    assert check in found, found
    assert words in found[check]
    with pytest.raises(InputRefused):
        checked_mesh(Surface(np.asarray(vertices), np.asarray(faces)))


def test_checks_behind_a_failure_are_not_reached():
    results = list(check_surface(Surface(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))))
    assert results[0].status == "failed"
    assert {r.status for r in results[3:]} == {"not reached"}


def test_messages_name_source_line_and_part():
    mesh = ball()
    faces = mesh.faces.copy()
    faces[5, 2] = 77
    lines = np.arange(len(faces)) + 100
    with pytest.raises(InputRefused, match=r"^x\.obj, facet 5 \(line 105\): 0-based corners .*--index-base"):
        checked_mesh(Surface(mesh.vertices, faces, None, lines), source="x.obj")


@pytest.mark.parametrize("shift", [-1, 1])
@pytest.mark.parametrize(
    "name", ["bennu_radar_1348", "bacchus_radar_2048", "eros_near_3897", "eros_near_856"]
)
def test_shifted_indices_are_caught_though_closed_and_consistently_wound(reference_shapes, name, shift):
    """The trap of 0-based tables: watertight, consistent, Euler number 2, and yet the wrong body."""
    from landing_cli.sources.shape_files import read_mesh

    mesh = read_mesh(reference_shapes / f"{name}.obj", "km")
    shifted = (mesh.faces + shift) % len(mesh.vertices)
    results = {r.name: r for r in check_surface(Surface(mesh.vertices, shifted))}
    assert results["closed"].status == results["one body"].status == "passed"
    assert "--index-base" in results["outward winding and support"].fault.fix


def test_checking_forty_thousand_facets_takes_a_fraction_of_a_second():
    import time

    mesh = fibonacci_ellipsoid((300.0, 200.0, 150.0), 20_002)
    began = time.process_time()
    assert not faults(mesh.vertices, mesh.faces)
    assert time.process_time() - began < 2.0  # 40,000 facets; 0.2 s measured
