"""Figures: maps that wrap, views that hide, files that are equal, flights drawn as they were stored."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gravity_helpers import icosphere
from matplotlib import rcParams
from PIL import Image

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.mesh import Mesh, facet_areas, facet_centroids, facet_normals
from landing_cli.cli.app import main
from landing_cli.errors import ExitCode, InputRefused, OutputRefused
from landing_cli.flight.legs import FinalArcLeg, ThrustNodesLeg
from landing_cli.flight.replay import replay
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.boundary import section_group, section_summary
from landing_cli.reach.figures import write_figures
from landing_cli.reach.figures.fields import border_segments, level_segments, spread_over_mesh
from landing_cli.reach.figures.parts import delta_v_scale, paint_verdicts, scale_levels
from landing_cli.reach.flown import flown_legs, flown_trajectory, rows_with_flight
from landing_cli.reach.records import FacetSolutions, LandingCase, Verdict, blank_rows
from landing_cli.reach.section import section_and_expansion
from landing_cli.reach.stored import CaseResult, ReachRun, run_to_tree
from landing_cli.reach.summary import summarise
from landing_cli.results import plotting
from landing_cli.results.identity import RunIdentity
from landing_cli.results.store import write
from landing_cli.results.surface_map import lon_lat_deg, map_surface, place_name
from landing_cli.results.surface_view import hidden, view_from

OCTAHEDRON = Mesh(
    np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]) * 100.0,
    np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]),
)
FLIGHT_FACET = 3


def turned(mesh: Mesh, seed: int = 1) -> Mesh:
    """Turn a mesh so that no vertex lies on the spin axis."""
    rotation, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return Mesh(mesh.vertices @ (rotation * np.sign(np.linalg.det(rotation))), mesh.faces)


def toy_run(asked: np.ndarray | None = None) -> ReachRun:
    """Two cases over a ball: the upper half reachable, one facet of it by a flight that was really flown."""
    mesh = turned(icosphere(100.0, 2))
    asteroid = Asteroid("ball", mesh, 4e-4, point_mass_field(0.5), 0.5)
    craft, centroids = Spacecraft(1000.0, 10.0, 300.0), facet_centroids(mesh)
    cases = []
    for name, start in (("pole", [0.0, 0.0, 300.0]), ("side", [200.0, -150.0, 100.0])):
        case = LandingCase(
            f"{name}_300s",
            asteroid,
            craft,
            np.array(start),
            np.array([0.0, 0.01, 0.0]),
            300.0,
            100.0,
            np.full(3, 110.0),
            1.0,
        )
        rows = blank_rows(np.arange(len(mesh.faces)) if asked is None else asked)
        own = centroids[rows["facet"]]
        up = own @ start / np.linalg.norm(start)
        rows["verdict"] = np.where(up > -20.0, Verdict.REACHABLE, Verdict.UNREACHABLE)
        rows["verdict"][:2] = Verdict.UNRESOLVED
        rows["proved"] = up < -40.0
        rows["violation"] = np.where(up > -20.0, 0.0, 0.25)
        rows["delta_v_m_s"] = np.where(up > -20.0, 4.0 - up / 50.0, np.nan)
        nodes = np.zeros((0, 3))
        if asked is None:
            nodes = with_flight(case, rows, centroids[FLIGHT_FACET])
        solutions = FacetSolutions(rows, nodes)
        cases.append(CaseResult(case, name, solutions, summarise(mesh, solutions)))
    return ReachRun(tuple(cases))


def with_flight(case: LandingCase, rows: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Store some descent to one facet, with the handover that it reaches; return its thrust nodes."""
    nodes = np.tile([[0.5, -1.0, -3.0]], (10, 1)) * np.linspace(1.0, -1.0, 10)[:, None]
    leg = ThrustNodesLeg(case.descent_s, nodes)
    body, craft = case.asteroid, case.spacecraft
    end = replay(
        case.position_m,
        case.velocity_m_s,
        craft.mass_kg,
        [leg, FinalArcLeg(1.0, np.ones(3), np.ones(3), target, body.gravity)],
        rotation_rate_rad_s=body.rotation_rate_rad_s,
        field=body.gravity,
        exhaust_velocity_m_s=craft.exhaust_velocity_m_s,
    )
    at = int(np.argmin(np.abs(end.t_s - case.descent_s)))
    row = rows[FLIGHT_FACET : FLIGHT_FACET + 1]
    row["verdict"], row["thrust_nodes"] = Verdict.REACHABLE, len(nodes)
    row["handover_position_m"], row["handover_velocity_m_s"] = end.position_m[at], end.velocity_m_s[at]
    row["delta_v_m_s"], row["fuel_kg"] = 2.0, 1.0
    row["performance_index_m2_s3"], row["peak_thrust_ratio"] = 0.01, 0.5
    return nodes


def with_section(run: ReachRun) -> ReachRun:
    """Add what section and expansion find."""
    from landing_cli.body.adjacency import facet_neighbours

    cases = []
    for result in run.cases:
        mesh = result.case.asteroid.mesh
        reachable = spread_over_mesh(result).reachable
        found = section_and_expansion(
            facet_centroids(mesh),
            facet_neighbours(mesh),
            result.case.position_m,
            25.0,
            0.0,
            lambda facets, known=reachable: known[facets],
        )
        summary = {**result.summary, "section": {**section_summary(found), "iou": 0.9, "misclassified": 3}}
        cases.append(replace(result, summary=summary, boundary=section_group(found)))
    return ReachRun(tuple(cases))


@pytest.fixture(scope="module")
def run() -> ReachRun:
    return toy_run()


def shoelace(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


@pytest.mark.parametrize(
    "mesh", [OCTAHEDRON, icosphere(100.0, 2), turned(icosphere(100.0, 1)), turned(OCTAHEDRON)]
)
def test_the_facets_of_a_star_shaped_body_tile_the_map_once(mesh: Mesh) -> None:
    surface = map_surface(mesh)
    once = {owner: polygon for polygon, owner in zip(surface.polygons, surface.owners.tolist(), strict=True)}
    assert len(once) == len(mesh.faces)
    areas = [shoelace(polygon) for polygon in once.values()]
    assert min(areas) > 0.0
    np.testing.assert_allclose(sum(areas), 360.0 * 180.0, rtol=1e-9, atol=0)


@pytest.mark.parametrize("mesh", [OCTAHEDRON, turned(icosphere(100.0, 1))])
def test_every_place_of_the_map_shows_the_facet_that_lies_there(mesh: Mesh) -> None:
    from matplotlib.path import Path as Outline

    surface = map_surface(mesh)
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(300, 3))
    corners = mesh.corners
    # a ray from the centre leaves through the facet whose three shares are all positive
    shares = np.linalg.solve(np.swapaxes(corners, 1, 2)[None], directions[:, None, :, None])[..., 0]
    least = (shares / np.abs(shares).sum(axis=2, keepdims=True)).min(axis=2)
    outlines = [Outline(polygon) for polygon in surface.polygons]
    looked_at = 0
    for place, facet, margin in zip(
        lon_lat_deg(directions), least.argmax(axis=1), least.max(axis=1), strict=True
    ):
        if margin > 0.02:  # near an edge, which is cut into chords of four degrees, its neighbour may show
            owners = surface.owners[[outline.contains_point(place) for outline in outlines]]
            assert owners.tolist() == [facet]
            looked_at += 1
    assert looked_at > 200


def test_places_are_named_by_hemisphere_and_poles_have_no_longitude() -> None:
    assert place_name([1.0, 0.0, 0.0]) == "0°, 0°"
    assert place_name([0.0, -2.0, 2.0]) == "45° N, 90° W"
    assert place_name([1.0, 1.0, -np.sqrt(2.0)], digits=1) == "45.0° S, 45.0° E"
    assert place_name([0.0, 0.0, 5.0]) == "90° N"


@pytest.mark.parametrize("toward", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (1, -2, 0.5)])
def test_a_view_is_a_right_handed_frame_that_keeps_lengths(toward: tuple[float, float, float]) -> None:
    view = view_from(toward)
    frame = np.stack([view.right, view.up, view.toward])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), rtol=0, atol=1e-14)
    np.testing.assert_allclose(np.cross(view.right, view.up), view.toward, rtol=0, atol=1e-14)
    np.testing.assert_allclose(view.toward, np.array(toward) / np.linalg.norm(toward), rtol=0, atol=1e-14)
    if toward[:2] != (0, 0):
        assert view.up[2] > 0.0


def test_a_ball_hides_what_lies_behind_and_inside_it_and_nothing_else() -> None:
    mesh = icosphere(100.0, 3)
    view = view_from((1.0, 2.0, 0.5))
    points = np.random.default_rng(5).uniform(-200.0, 200.0, size=(2000, 3))
    across, depth = np.linalg.norm(view.flat(points), axis=1), view.depth(points)
    clear_of_limb = np.abs(across - 100.0) > 2.0
    front = np.sqrt(np.maximum(100.0**2 - across**2, 0.0))
    clear_of_front = np.abs(depth - front) > 2.0
    told = hidden(mesh, view, points)
    truth = (across < 100.0) & (depth < front)
    sure = clear_of_limb & clear_of_front
    assert sure.sum() > 1500
    np.testing.assert_array_equal(told[sure], truth[sure])
    centroids = facet_centroids(mesh)
    facing = facet_normals(mesh) @ view.toward
    assert not hidden(mesh, view, centroids)[facing > 0.05].any()
    assert hidden(mesh, view, centroids)[facing < -0.2].all()


def test_level_lines_of_a_ball_run_along_the_level_and_close() -> None:
    mesh = icosphere(1.0, 4)
    values = facet_centroids(mesh)[:, 2] / np.linalg.norm(facet_centroids(mesh), axis=1)
    segments = level_segments(mesh, values, np.array([0.3]))
    np.testing.assert_allclose(segments[..., 2], 0.3, rtol=0, atol=5e-3)
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum()
    np.testing.assert_allclose(length, 2.0 * np.pi * np.sqrt(1.0 - 0.09), rtol=5e-3, atol=0)
    _, counts = np.unique(np.round(segments.reshape(-1, 3), 9), axis=0, return_counts=True)
    assert (counts == 2).all()
    values[values < 0.5] = np.nan
    assert len(level_segments(mesh, values, np.array([0.3]))) == 0


def test_the_boundary_of_a_domain_is_closed_and_parts_it_from_the_rest() -> None:
    mesh = icosphere(1.0, 2)
    inside = facet_centroids(mesh)[:, 0] > 0.2
    segments = border_segments(mesh, inside, ~inside)
    _, counts = np.unique(np.round(segments.reshape(-1, 3), 12), axis=0, return_counts=True)
    assert (counts % 2 == 0).all()
    alone = np.arange(len(mesh.faces)) == 7
    assert len(border_segments(mesh, alone, ~alone)) == 3


def test_every_facet_has_one_colour_of_its_verdict(run: ReachRun) -> None:
    fields = spread_over_mesh(run.cases[0])
    paint = paint_verdicts(fields)
    counts = {entry.label: entry.facets for entry in paint.key}
    assert sum(counts.values()) == len(fields.asked)
    assert counts["unresolved"] == 2 == paint.hatched.sum()
    assert counts["reachable"] == fields.reachable.sum()
    assert len(np.unique(paint.colours, axis=0)) == len(counts)


def test_levels_are_round_and_the_scale_holds_every_value(run: ReachRun) -> None:
    scale = delta_v_scale(run)
    low, high = scale.get_clim()
    values = np.concatenate([spread_over_mesh(case).delta_v_m_s for case in run.cases])
    assert low <= np.nanmin(values) and np.nanmax(values) <= high
    levels = scale_levels(scale)
    assert 3 <= len(levels) <= 11
    np.testing.assert_allclose(np.diff(levels), 0.5, rtol=1e-12, atol=0)


def test_delta_v_colours_are_told_apart_by_lightness_alone() -> None:
    colours = plotting.delta_v_colours()
    rgb = colours(np.arange(colours.N))[:, :3]
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    assert (np.diff(linear @ [0.2126, 0.7152, 0.0722]) > 0.0).all()


def test_the_same_run_gives_the_same_bytes_whatever_the_users_style(tmp_path: Path, run: ReachRun) -> None:
    first = [path.read_bytes() for path in write_figures(run, tmp_path / "a", "pole_300s")]
    before = rcParams["font.size"], rcParams["axes.facecolor"]
    try:
        rcParams.update({"font.size": 17.0, "axes.facecolor": "black"})
        second = [path.read_bytes() for path in write_figures(run, tmp_path / "b", "pole_300s")]
        assert rcParams["font.size"] == 17.0
    finally:
        rcParams.update({"font.size": before[0], "axes.facecolor": before[1]})
    assert first == second
    for data in first:
        image = Image.open(io.BytesIO(data))
        assert image.getpixel((1, 1)) == (255, 255, 255)
        assert np.allclose(image.info["dpi"], 150, atol=0.1)
        assert set(image.info) == {"dpi"}


def test_importing_figures_starts_no_pyplot_and_no_matplotlib() -> None:
    code = "import sys, landing_cli.reach.figures; print([m for m in sys.modules if m == 'matplotlib'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    code = (
        "import sys; from landing_cli.results import plotting\n"
        "with plotting.style():\n    plotting.to_png(plotting.new_figure(1, 1))\n"
        "print('matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_a_run_gives_an_overview_and_two_maps_a_case_and_the_boundary_where_there_is_one(
    tmp_path: Path, run: ReachRun
) -> None:
    names = [path.name for path in write_figures(with_section(run), tmp_path / "r")]
    kinds = ("verdict", "delta-v", "boundary")
    cases = ("pole_300s", "side_300s")
    assert names == ["r-overview.png", *(f"r-{case}-{kind}.png" for case in cases for kind in kinds)]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)


def test_a_run_that_asked_a_part_of_the_facets_is_drawn_and_says_so(tmp_path: Path) -> None:
    from landing_cli.reach.figures.parts import case_title

    part = toy_run(np.arange(0, 320, 7))
    assert len(list(write_figures(part, tmp_path / "p"))) == 5
    assert "of 46 facets asked reachable" in case_title(part.cases[0])
    assert "not asked" in {entry.label for entry in paint_verdicts(spread_over_mesh(part.cases[0])).key}


def test_a_run_without_a_reachable_facet_is_drawn(tmp_path: Path, run: ReachRun) -> None:
    rows = blank_rows(np.arange(320))
    rows["verdict"] = Verdict.UNREACHABLE
    nothing = replace(run.cases[0], solutions=FacetSolutions(rows, np.zeros((0, 3))))
    assert len(list(write_figures(ReachRun((nothing,)), tmp_path / "n"))) == 3


def test_the_stored_control_of_a_facet_lands_at_rest_on_its_centroid(run: ReachRun) -> None:
    result = run.cases[1]
    assert np.flatnonzero(rows_with_flight(result.solutions)).tolist() == [FLIGHT_FACET]
    descent, final = flown_legs(result.case, result.solutions, FLIGHT_FACET)
    assert isinstance(descent, ThrustNodesLeg) and isinstance(final, FinalArcLeg)
    flight = flown_trajectory(result, FLIGHT_FACET)
    target = facet_centroids(result.case.asteroid.mesh)[FLIGHT_FACET]
    assert flight.t_s[-1] == pytest.approx(300.0, rel=1e-12)
    np.testing.assert_allclose(flight.position_m[-1], target, rtol=0, atol=1e-6)
    np.testing.assert_allclose(flight.velocity_m_s[-1], 0.0, rtol=0, atol=1e-8)


def test_costates_stand_for_the_flight_where_no_thrust_nodes_are_stored(run: ReachRun) -> None:
    rows = run.cases[0].solutions.rows.copy()
    rows["thrust_nodes"], rows["costates"][FLIGHT_FACET] = 0, np.arange(7.0)
    solutions = FacetSolutions(rows, np.zeros((0, 3)))
    descent, _ = flown_legs(run.cases[0].case, solutions, FLIGHT_FACET)
    np.testing.assert_array_equal(descent.costates, np.arange(7.0))
    assert (descent.duration_s, descent.thrust_max_n) == (200.0, 10.0)


def test_the_flight_to_a_facet_is_drawn_as_histories_and_path(tmp_path: Path, run: ReachRun) -> None:
    names = [path.name for path in write_figures(run, tmp_path / "f", "side_300s", FLIGHT_FACET)]
    assert names == [f"f-side_300s-facet3-{kind}.png" for kind in ("histories", "descent")]


def test_wrong_choices_are_refused_with_the_reason(tmp_path: Path, run: ReachRun) -> None:
    unreachable = int(np.flatnonzero(run.cases[0].solutions.rows["verdict"] == Verdict.UNREACHABLE)[5])
    wrong = [
        ("pole_400s", None, "no case 'pole_400s'.*take one of pole_300s, side_300s"),
        (None, 3, "belongs to one case.*--case"),
        ("pole_300s", unreachable, "it is unreachable, and the best attempt breaks a constraint by 0.25"),
        ("pole_300s", 0, "it is unresolved"),
        ("pole_300s", 320, "no such facet.*0 to 319"),
        ("pole_300s", -1, "no such facet"),
    ]
    for case, facet, message in wrong:
        with pytest.raises(InputRefused, match=message):
            list(write_figures(run, tmp_path / "w", case, facet))
    part = toy_run(np.arange(0, 320, 7))
    with pytest.raises(InputRefused, match="never asked for this facet"):
        list(write_figures(part, tmp_path / "w", "pole_300s", 3))
    lost = replace(run.cases[0], lost={1: "its worker process died"})
    with pytest.raises(InputRefused, match="unresolved, lost because its worker process died"):
        list(write_figures(ReachRun((lost,)), tmp_path / "w", None, 1))
    assert list(tmp_path.iterdir()) == []


def test_a_figure_that_cannot_be_written_is_refused_and_leaves_nothing(tmp_path: Path, run: ReachRun) -> None:
    with pytest.raises(OutputRefused, match="--out"):
        list(write_figures(run, tmp_path / "missing" / "r", "pole_300s"))
    assert list(tmp_path.iterdir()) == []


def test_the_command_prints_the_paths_it_wrote(
    tmp_path: Path, run: ReachRun, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "ball-reach-run.h5", tmp_path / "new" / "figures"
    identity = RunIdentity("reach run", "name: ball\n", "ab" * 32, "0.1.0")
    write(path, run_to_tree(run), {"mission": "reach", "complete": 1, **identity.as_dict()}, {})
    assert main("landing", ["results", "plot", str(path), "--case", "pole_300s"]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed == [str(tmp_path / f"ball-reach-run-pole_300s-{k}.png") for k in ("verdict", "delta-v")]
    arguments = [
        "results",
        "plot",
        str(path),
        "--case",
        "pole_300s",
        "--facet",
        "3",
        "--out",
        str(out),
        "--json",
    ]
    assert main("landing", arguments) == 0
    written = json.loads(capsys.readouterr().out)
    assert written == [
        str(out / f"ball-reach-run-pole_300s-facet3-{k}.png") for k in ("histories", "descent")
    ]
    assert all(Path(name).is_file() for name in written)
    assert main("landing", ["results", "plot", str(path), "--case", "nowhere"]) == ExitCode.REFUSED
    assert "take one of pole_300s, side_300s" in capsys.readouterr().err


def test_the_title_tells_body_case_and_reachable_area(run: ReachRun) -> None:
    from landing_cli.reach.figures.parts import case_title

    fields = spread_over_mesh(run.cases[0])
    area = facet_areas(run.asteroid.mesh)[fields.reachable].sum() / 1e6
    count = int(fields.reachable.sum())
    assert case_title(run.cases[0]).startswith(f"Ball, pole_300s: {count} of 320 facets reachable (")
    assert case_title(run.cases[0]).endswith(f"{area:.3f} km²")
