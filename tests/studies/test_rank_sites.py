"""The ranking of landing sites: slopes and roughness against closed forms; what leaves the order alone."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from test_cli_results import NO, YES, stored_run

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.mesh import Mesh, facet_areas, facet_centroids, facet_normals
from landing_cli.cli.app import main
from landing_cli.errors import ExitCode, InputRefused
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import FacetSolutions, LandingCase, blank_rows
from landing_cli.reach.stored import CaseResult, ReachRun, run_to_tree
from landing_cli.reach.summary import summarise
from landing_cli.results.identity import RunIdentity
from landing_cli.results.store import write
from landing_cli.studies.rank.measures import roughness_m, slopes_deg
from landing_cli.studies.rank.score import distinct_sites, goodness

AXES = np.array([300.0, 250.0, 200.0])
GM, SPIN = 5.0, 3e-4


def on_ellipsoid(count: int = 400, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Points of an ellipsoid and its outward unit normals there."""
    rng = np.random.default_rng(seed)
    unit = rng.normal(size=(count, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    normals = unit / AXES
    return unit * AXES, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_slope_of_an_ellipsoid_under_a_point_mass_that_spins() -> None:
    """Closed form: cos = n . (GM r/|r|^3 - w^2 (x, y, 0)) / |...|."""
    points, normals = on_ellipsoid()
    up = GM * points / np.linalg.norm(points, axis=1, keepdims=True) ** 3
    up -= SPIN**2 * points * (1.0, 1.0, 0.0)
    cosine = (up * normals).sum(axis=1) / np.linalg.norm(up, axis=1)
    found = slopes_deg(points, normals, point_mass_field(GM), SPIN)
    np.testing.assert_allclose(np.cos(np.radians(found)), cosine, rtol=1e-13, atol=0)
    assert found.max() > 10.0
    still = slopes_deg(points, normals, point_mass_field(GM), 0.0)
    assert np.abs(found - still).max() > 1.0, "the spin must count"


def test_a_sphere_is_level_and_a_spheroid_of_equilibrium_too() -> None:
    unit = on_ellipsoid()[0] / AXES
    assert slopes_deg(250.0 * unit, unit, point_mass_field(GM), 0.0).max() < 1e-6
    # an equipotential of point mass and spin: the normal is along the effective gravity by construction
    polar = GM / 250.0
    radius = np.full(len(unit), 250.0)
    flat = unit[:, 0] ** 2 + unit[:, 1] ** 2
    for _ in range(60):
        radius = GM / (polar - 0.5 * SPIN**2 * radius**2 * flat)
    points = radius[:, None] * unit
    step = 1e-3

    def potential(p: np.ndarray) -> np.ndarray:
        return GM / np.linalg.norm(p, axis=1) + 0.5 * SPIN**2 * (p[:, :2] ** 2).sum(axis=1)

    gradient = [(potential(points + e) - potential(points - e)) / (2 * step) for e in step * np.eye(3)]
    normals = -np.stack(gradient, axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert slopes_deg(points, normals, point_mass_field(GM), SPIN).max() < 1e-3


def test_an_overhang_leans_beyond_the_horizontal() -> None:
    found = slopes_deg(
        np.array([[0.0, 0.0, 100.0]] * 2), np.array([[0.0, 0, -1], [1, 0, 0]]), point_mass_field(1.0), 0.0
    )
    np.testing.assert_allclose(found, [180.0, 90.0], rtol=1e-12, atol=0)


def sheet(height: object, spacing_m: float = 1.0, size: int = 60) -> Mesh:
    """A square of triangles over a plane, raised by a function of x and y."""
    x, y = (axis.ravel() for axis in np.meshgrid(*[spacing_m * np.arange(size + 1.0)] * 2, indexing="ij"))
    corner = np.arange((size + 1) ** 2).reshape(size + 1, size + 1)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    return Mesh(np.stack([x, y, height(x, y)], axis=1), faces)  # type: ignore[operator]


def middle_of(mesh: Mesh) -> int:
    centroids = facet_centroids(mesh)
    return int(np.argmin(np.linalg.norm(centroids[:, :2] - centroids[:, :2].mean(axis=0), axis=1)))


def test_a_plane_is_smooth_however_it_leans() -> None:
    mesh = sheet(lambda x, y: 0.4 * x - 0.7 * y + 3.0, size=20)
    assert roughness_m(mesh, 4.0).max() < 1e-6


def test_roughness_of_a_sine_is_its_root_mean_square() -> None:
    """z = a sin(k x), straight between vertices h apart: a sqrt((2 + cos k h) / 6) over whole waves."""
    amplitude, wave, spacing = 0.05, 4.0, 1.0
    mesh = sheet(lambda x, y: amplitude * np.sin(2 * np.pi * x / wave), spacing_m=spacing, size=26)
    found = roughness_m(mesh, 12.0)[middle_of(mesh)]
    exact = amplitude * np.sqrt((2 + np.cos(2 * np.pi * spacing / wave)) / 6)
    assert found == pytest.approx(exact, rel=1e-2)
    doubled = Mesh(mesh.vertices * (1, 1, 2), mesh.faces)
    assert roughness_m(doubled, 12.0)[middle_of(doubled)] == pytest.approx(2 * found, rel=5e-3)


def test_roughness_is_the_least_mean_square_over_all_planes() -> None:
    """Against a quadrature that is exact for squares (edge midpoints) and a plane from singular values."""
    rng = np.random.default_rng(5)
    bumps = rng.normal(size=(21, 21))
    mesh = sheet(lambda x, y: 0.3 * bumps[x.astype(int), y.astype(int)], size=20)
    mesh = Mesh(mesh.vertices + np.array([5e3, -2e3, 1e4]), mesh.faces)
    radius, centroids = 4.2, facet_centroids(mesh)
    found = roughness_m(mesh, radius)
    for facet in (0, 17, middle_of(mesh), 700):
        near = np.linalg.norm(centroids - centroids[facet], axis=1) <= radius
        near &= facet_normals(mesh) @ facet_normals(mesh)[facet] > 0.0
        corners = mesh.corners[near] - centroids[facet]
        nodes = 0.5 * (corners + np.roll(corners, -1, axis=1)).reshape(-1, 3)
        weights = np.repeat(facet_areas(mesh)[near] / 3.0, 3)
        weights /= weights.sum()
        about = np.sqrt(weights)[:, None] * (nodes - weights @ nodes)
        # float64 keeps 1e4 m to 2e-12 m; the singular value is of metres
        assert found[facet] == pytest.approx(np.linalg.svd(about, compute_uv=False)[-1], rel=1e-9, abs=0)


def test_the_other_side_of_a_thin_body_is_no_neighbourhood() -> None:
    top = sheet(lambda x, y: np.zeros_like(x), size=12)
    count = len(top.vertices)
    both = Mesh(
        np.concatenate([top.vertices, top.vertices - (0, 0, 0.5)]),
        np.concatenate([top.faces, top.faces[:, ::-1] + count]),
    )
    assert roughness_m(both, 3.0).max() < 1e-6


def test_a_radius_without_neighbours_is_refused_with_one_that_has_them() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=100.0)
    mesh = Mesh(np.asarray(sphere.vertices), np.asarray(sphere.faces))
    with pytest.raises(InputRefused, match="no plane to measure from") as caught:
        roughness_m(mesh, 5.0)
    enough = float(caught.value.fix.split()[0])
    assert (roughness_m(mesh, enough) > 0.0).all()
    corner = Mesh(np.eye(4, 3) * 100.0, np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]))
    with pytest.raises(InputRefused, match="too coarse for a neighbourhood"):
        roughness_m(corner, 500.0)


def test_measures_run_from_the_worst_candidate_to_the_best() -> None:
    values = np.array([3.0, np.nan, 1.0, 2.0])
    np.testing.assert_array_equal(goodness(values, more_is_better=False), [0.0, np.nan, 1.0, 0.5])
    np.testing.assert_array_equal(goodness(values, more_is_better=True), [1.0, np.nan, 0.0, 0.5])
    np.testing.assert_array_equal(goodness(np.array([2.0, np.nan]), more_is_better=True), [1.0, np.nan])
    # another unit, another zero: the same parts
    np.testing.assert_allclose(
        goodness(57.3 * values - 4.0, more_is_better=False)[[0, 2, 3]], [0, 1, 0.5], rtol=1e-15, atol=1e-15
    )


def test_listed_sites_keep_their_distance() -> None:
    rng = np.random.default_rng(1)
    points, score = rng.uniform(0, 100, (500, 3)), rng.uniform(size=500)
    score[::7] = np.nan
    listed = distinct_sites(score, points, 30.0, 500)
    apart = np.linalg.norm(points[listed][:, None] - points[listed][None], axis=2)
    assert (apart[np.triu_indices(len(listed), 1)] >= 30.0).all()
    assert (np.diff(score[listed]) <= 0.0).all()
    left_out = np.setdiff1d(np.flatnonzero(np.isfinite(score)), listed)
    nearest = np.linalg.norm(points[left_out][:, None] - points[listed][None], axis=2)
    better = score[listed][None] >= score[left_out][:, None]
    assert ((nearest < 30.0) & better).any(axis=1).all(), "who is left out is near a better one"
    everyone = distinct_sites(score, points, 0.0, 500)
    assert len(everyone) == np.isfinite(score).sum()


COUNT = 80


def run_file(folder: Path, columns: dict[str, dict[int, float]] | None = None) -> Path:
    """Write a run over a ball of 80 facets, of which 10, 20 and 30 are reachable."""
    sphere = trimesh.creation.icosphere(subdivisions=1, radius=150.0)
    body = Mesh(np.asarray(sphere.vertices) * (1.2, 1.0, 0.9), np.asarray(sphere.faces))
    asteroid = Asteroid("rock", body, 1e-4, point_mass_field(1.0), 1.0)
    case = LandingCase(
        "top_700s",
        asteroid,
        Spacecraft(1000.0, 10.0, 300.0),
        np.array([0, 0, 900.0]),
        np.zeros(3),
        700.0,
        200.0,
        np.full(3, 200.0),
        1.0,
    )
    known: dict[str, dict[int, float]] = {
        "delta_v_m_s": {10: 3.0, 20: 4.0, 30: 5.0},
        "peak_thrust_ratio": {10: 0.5, 20: 1.0, 30: 0.75},
        "terrain_clearance_min_m": {10: 5.0, 20: 5.0, 30: 5.0},
    }
    rows = blank_rows(np.arange(COUNT))
    rows["verdict"] = NO
    rows["verdict"][list(known["delta_v_m_s"])] = YES
    for name, values in {**known, **(columns or {})}.items():
        rows[name][list(values)] = list(values.values())
    solutions = FacetSolutions(rows, np.zeros((0, 3)))
    run = ReachRun((CaseResult(case, "top", solutions, summarise(body, solutions)),))
    identity = RunIdentity("reach run", "name: rock\n", "ab" * 32, "0.1.0")
    write(folder / "a.h5", run_to_tree(run), {"mission": "reach", "complete": 1, **identity.as_dict()}, {})
    return folder / "a.h5"


def ranked(capsys: pytest.CaptureFixture[str], path: Path, *arguments: str) -> dict[str, object]:
    wide = ["--radius-m", "200", "--spacing-m", "0", "--json"]
    assert main("reach", ["rank", str(path), *wide, *arguments]) == 0
    value: dict[str, object] = json.loads(capsys.readouterr().out)
    return value


def test_scaled_weights_leave_the_order_and_the_score(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = run_file(tmp_path)
    first = ranked(capsys, path, "--weight", "margin=1,delta_v=3,slope=0.5")
    second = ranked(capsys, path, "--weight=margin=10,delta_v=30", "--weight", "slope=5,roughness=10")
    assert first["sites"] == second["sites"]
    assert first["weights"] == pytest.approx(second["weights"])


def test_one_weight_alone_orders_by_its_measure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = run_file(tmp_path)
    for name, order in (("delta_v", [10, 20, 30]), ("margin", [10, 30, 20])):
        others = ",".join(f"{n}=0" for n in ("margin", "delta_v", "slope", "roughness") if n != name)
        value = ranked(capsys, path, "--weight", others)
        sites = value["sites"]
        assert isinstance(sites, list)
        assert [site["facet"] for site in sites] == order
        assert value["margin"] == "1 - peak_thrust_ratio"
        assert (sites[0]["score"], sites[-1]["score"]) == (1.0, 0.0)
        assert sites[0]["score"] == pytest.approx(sum(sites[0][f"score_{n}"] for n in ("delta_v", "margin")))


def test_the_thrust_margin_counts_where_the_run_has_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    margins = {10: 0.1, 20: 0.3, 30: 0.2, 40: -0.1}
    path = run_file(tmp_path, {"thrust_margin": margins, "terrain_clearance_min_m": {30: -1.0}})
    value = ranked(capsys, path, "--weight", "delta_v=0,slope=0,roughness=0")
    sites = value["sites"]
    assert isinstance(sites, list)
    assert value["margin"] == "thrust_margin"
    assert [site["facet"] for site in sites] == [20, 10], "the path to facet 30 cuts the mesh"
    assert value["paths_through_rock"] == 1


def test_a_table_and_files_for_every_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = run_file(tmp_path)
    names = [tmp_path / f"x.{form}" for form in ("csv", "json", "png", "ply", "vtp", "obj")]
    outputs = [argument for name in names for argument in ("-o", str(name))]
    assert (
        main("reach", ["rank", str(path), "--radius-m", "200", "--top", "2", "--spacing-m", "0", *outputs])
        == 0
    )
    out, err = capsys.readouterr()
    assert out.splitlines()[0].split()[:3] == ["rank", "facet", "longitude_deg"]
    assert "3 candidates: reachable in top_700s" in err
    assert "slope against point_mass gravity" in err
    rows = list(csv.DictReader(names[0].read_text().splitlines()))
    assert len(rows) == 2
    assert json.loads(names[1].read_text())[0]["facet"] == int(rows[0]["facet"])
    assert names[2].read_bytes().startswith(b"\x89PNG")
    assert b'Name="slope_deg"' in names[4].read_bytes()
    assert main("reach", ["rank", str(path), "--radius-m", "200", *outputs]) == ExitCode.REFUSED
    assert "is there already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        ("--weight slop=1", ExitCode.USAGE, "'slop' is no measure; did you mean slope?"),
        ("--weight slope", ExitCode.USAGE, "is not of the form name=weight"),
        ("--weight slope=much", ExitCode.USAGE, "'much' is no number"),
        ("--weight slope=1,slope=2", ExitCode.USAGE, "slope has two weights"),
        ("--weight slope=-1", ExitCode.REFUSED, "slope has the weight -1"),
        ("--weight slope=nan", ExitCode.REFUSED, "slope has the weight nan"),
        ("--weight margin=0,delta_v=0,slope=0,roughness=0", ExitCode.REFUSED, "every weight is 0"),
        ("--radius-m 0", ExitCode.USAGE, "0 is no radius"),
        ("--radius-m 30", ExitCode.REFUSED, "no plane to measure from; 77 m would do"),
        ("--spacing-m nan", ExitCode.USAGE, "nan is no distance"),
        ("--case nowhere", ExitCode.REFUSED, "take one of top_700s"),
        ("-o x.pdf", ExitCode.USAGE, "'.pdf' tells no format"),
        ("-o no/such/folder/x.csv --radius-m 200", ExitCode.REFUSED, "no/such/folder"),
        ("--top 0", ExitCode.USAGE, "--top"),
    ],
)
def test_what_cannot_be_ranked_is_refused(
    arguments: str,
    code: int,
    told: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    run_file(tmp_path)
    assert main("reach", ["rank", "a.h5", *arguments.split()]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert told in err
    assert "Traceback" not in err
    assert sorted(tmp_path.iterdir()) == [tmp_path / "a.h5"]


def test_nothing_to_rank_is_nothing_feasible(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = stored_run(tmp_path / "n.h5", [NO, NO, NO, NO])
    assert main("reach", ["rank", str(path)]) == ExitCode.NOTHING_FEASIBLE
    assert "no facet is reachable" in capsys.readouterr().err
    path = run_file(tmp_path, {"terrain_clearance_min_m": {10: -1.0, 20: -2.0, 30: -3.0}})
    assert main("reach", ["rank", str(path)]) == ExitCode.NOTHING_FEASIBLE
    assert "every path to the 3 reachable facets cuts the mesh" in capsys.readouterr().err
