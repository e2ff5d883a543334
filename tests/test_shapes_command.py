"""``landing shapes``: data on stdout, words on stderr, the right exit codes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from shape_helpers import fibonacci_ellipsoid
from test_download import Server, server  # noqa: F401 (a fixture)

from landing_cli.body.mesh import Mesh
from landing_cli.cli.app import main
from landing_cli.errors import InputRefused
from landing_cli.sources import shape_archive
from landing_cli.sources.shape_files import read_mesh, write_obj
from landing_cli.sources.shape_search import find_shape, shape_folders

BODY = fibonacci_ellipsoid((300.0, 200.0, 150.0), 200)


@pytest.fixture
def workplace(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("LANDING_REFERENCE_DATA", raising=False)
    write_obj(tmp_path / "egg.obj", BODY, [], "km")
    return tmp_path


def run(capsys, *arguments: str) -> tuple[int, str, str]:
    code = main("landing", ["shapes", *arguments])
    out, err = capsys.readouterr()
    return code, out, err


def test_list_shows_what_is_here_and_what_is_shipped(workplace, capsys, monkeypatch):
    (workplace / "reference" / "shapes").mkdir(parents=True)
    write_obj(workplace / "reference" / "shapes" / "far.obj", BODY, [], "km")
    (workplace / "broken.obj").write_text("v 1 2\n")
    monkeypatch.setenv("LANDING_REFERENCE_DATA", str(workplace / "reference"))
    code, out, _ = run(capsys, "list", "--json")
    rows = {row["name"]: row for row in json.loads(out)}
    assert code == 0
    assert (rows["egg.obj"]["vertices"], rows["egg.obj"]["facets"]) == (200, 396)
    assert rows["far.obj"]["facets"] == 396
    assert rows["bennu.obj"]["facets"] == 2692
    assert rows["broken.obj"]["format"] == "not readable: a vertex of 2 numbers"
    code, out, _ = run(capsys, "list")
    assert code == 0
    assert "eros.obj" in out


def test_info_prints_figures_of_the_ellipsoid(workplace, capsys):
    code, out, err = run(capsys, "info", "egg", "--json")
    figures = json.loads(out)
    assert code == 0
    assert err == "read egg.obj\n"
    assert figures["vertices"] == 200
    assert figures["star_shaped"] is True
    assert figures["indices_from"] == 1
    np.testing.assert_allclose(figures["ellipsoid_m"], [300, 200, 150], rtol=1e-3)
    np.testing.assert_allclose(figures["volume_km3"], 4e-9 / 3 * np.pi * 9e6, rtol=0.03)
    radius = figures["reference_radius_m"]
    np.testing.assert_allclose(radius, np.cbrt(9e6), rtol=0.01)
    # C20 = (c^2 - (a^2 + b^2)/2) / (5 R^2), C22 = (a^2 - b^2) / (20 R^2) for a uniform ellipsoid.
    np.testing.assert_allclose(figures["c20"], (150**2 - (300**2 + 200**2) / 2) / (5 * radius**2), rtol=0.03)
    np.testing.assert_allclose(figures["c22"], (300**2 - 200**2) / (20 * radius**2), rtol=0.03)
    assert figures["principal_axis_3_to_xyz_deg"][2] < 0.5
    code, out, _ = run(capsys, "info", "egg.obj", "--reference-radius", "1000")
    assert code == 0
    assert "star_shaped" in out
    assert "yes" in out


def test_check_passes_a_sound_shape_and_names_the_fault_of_a_broken_one(workplace, capsys):
    code, out, _ = run(capsys, "check", "egg.obj", "--json")
    assert code == 0
    assert json.loads(out)["sound"] is True
    write_obj(workplace / "inside_out.obj", Mesh(BODY.vertices, BODY.faces[:, ::-1]), [], "km")
    code, out, err = run(capsys, "check", "inside_out.obj")
    assert code == 3
    assert "outward winding and support           failed" in out
    assert "positive volume                       not reached" in out
    assert "warning: outward winding and support: every facet is wound inwards; reverse" in err


def test_import_converts_a_table_of_metres_that_counts_from_0(workplace, capsys):
    rows = [f"{x:.3f} {y:.3f} {z:.3f}" for x, y, z in BODY.vertices]
    rows += [f"{a} {b} {c}" for a, b, c in BODY.faces]
    (workplace / "plates.tab").write_text("\r\n".join(rows))
    code, out, err = run(capsys, "import", "plates.tab", "--unit", "m")
    assert (code, out, err) == (0, "", "wrote plates.obj\n")
    np.testing.assert_array_equal(read_mesh("plates.obj", "km").faces, BODY.faces)
    assert "Imported from plates.tab: plain table, m, from 0" in Path("plates.obj").read_text()
    code, _, err = run(capsys, "import", "plates.tab", "--unit", "m")
    assert code == 3
    assert err == "error: plates.obj: is there already; take another name, or --force\n"
    assert run(capsys, "import", "plates.tab", "--unit", "m", "--force")[0] == 0


def test_import_wants_the_unit_stated_and_right(workplace, capsys):
    assert run(capsys, "import", "egg.obj", "-o", "x.obj")[0] == 2
    code, _, err = run(capsys, "import", "egg.obj", "--unit", "m", "-o", "x.obj")
    assert code == 3
    assert "are the coordinates in km?" in err
    assert not Path("x.obj").exists()


def test_resample_writes_the_mesh_and_prints_its_deviation(workplace, capsys):
    code, out, err = run(capsys, "resample", "egg", "-n", "100", "--note", "an egg", "--json")
    figures = json.loads(out)
    assert code == 0
    assert err == "read egg.obj\nwrote egg_100.obj\n"
    assert figures["facets"] == 196
    assert abs(figures["volume_ratio_minus_1"]) < 1e-6
    assert figures["source_to_new_rms_m"] < 5.0
    text = Path("egg_100.obj").read_text()
    assert text.startswith("# an egg\n# 100 vertices, 196 facets, km")
    assert len(read_mesh("egg_100.obj", "km").faces) == 196


def test_resample_refuses_an_overhang_by_name(workplace, capsys):
    vertices = BODY.vertices.copy()
    vertices[100] = vertices[100] * 1.5 + np.array([0.0, 0.0, 150.0])
    write_obj("hook.obj", Mesh(vertices, BODY.faces), [], "km")
    code, _, err = run(capsys, "resample", "hook.obj", "-n", "100")
    assert code == 3
    assert "hook.obj, facet " in err
    assert "not star-shaped" in err
    assert not Path("hook_100.obj").exists()


def test_fetch_downloads_checks_and_converts(workplace, capsys, server, monkeypatch):  # noqa: F811
    assert isinstance(server, Server)
    official = shape_archive.OfficialShape("egg", f"{server.url}/data/good.tab")
    server.files["/data/good.tab"] = server.files["/data/good.tab"].replace(b"# \r\n", b"")
    monkeypatch.setitem(shape_archive.OFFICIAL_SHAPES, "egg", official)
    code, out, err = run(capsys, "fetch", "egg")
    assert (code, out) == (0, "shapes/good.obj\n")
    assert "downloaded shapes/good.tab (sha256 " in err
    assert len(read_mesh("shapes/good.obj", "km").faces) == 76
    code, out, err = run(capsys, "fetch", "egg")
    assert (code, out) == (0, "shapes/good.obj\n")
    assert "found shapes/good.tab" in err
    code, out, _ = run(capsys, "fetch", "--url", official.url, "--unit", "km", "--into", "elsewhere")
    assert (code, out) == (0, "elsewhere/good.obj\n")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "name a body or a --url"),
        (["bennu", "--url", "http://x/a.tab"], "name a body or a --url"),
        (["--url", "http://x/a.tab"], "add --unit km or m"),
        (["ceres"], "no official file is known for 'ceres'; the bodies are bennu, bacchus, eros"),
        (["bennu", "--unit", "m"], "the file of bennu is in km"),
        (["--url", "file:///etc/passwd", "--unit", "m"], "is no http or https URL"),
    ],
)
def test_fetch_refuses_wrong_usage(workplace, capsys, arguments, words):
    code, out, err = run(capsys, "fetch", *arguments)
    assert (code, out) == (2, "")
    assert words in err


def test_the_search_goes_from_the_scenario_outwards_and_names_every_place(workplace, monkeypatch):
    for folder in ("beside", "shapes", "reference/shapes"):
        (workplace / folder).mkdir(parents=True)
        (workplace / folder / "a.obj").write_text("")
    monkeypatch.setenv("LANDING_REFERENCE_DATA", "reference")
    beside = workplace / "beside"
    assert find_shape("a.obj", beside) == beside / "a.obj"
    (beside / "a.obj").unlink()
    assert find_shape("a", beside) == Path("shapes/a.obj")
    (workplace / "shapes" / "a.obj").unlink()
    assert find_shape("a.obj", beside) == Path("reference/shapes/a.obj")
    assert find_shape(str(workplace / "reference/shapes/a.obj")).is_absolute()
    with pytest.raises(InputRefused) as caught:
        find_shape("benu.obj", beside)
    for folder in shape_folders(beside):
        assert str(folder.resolve()) in str(caught.value)
    assert "did you mean bennu.obj" in str(caught.value)
    monkeypatch.delenv("LANDING_REFERENCE_DATA")
    with pytest.raises(InputRefused, match="LANDING_REFERENCE_DATA is not set"):
        find_shape("bennu_radar_1348.obj")


@pytest.mark.parametrize("name", ["", "a\0b", "x" * 5000, "shapes"])
def test_odd_names_are_refused(workplace, name):
    (workplace / "shapes").mkdir()
    with pytest.raises(InputRefused):
        find_shape(name)


def test_help_needs_no_heavy_import():
    code = (
        "import sys; from landing_cli.cli.app import main; main('landing', ['shapes', '--help']);"
        "print(sorted({'numpy', 'scipy', 'numba', 'trimesh', 'requests', 'pooch'} & set(sys.modules)))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.splitlines()[-1] == "[]"
    for command in ("list", "info", "check", "import", "resample", "fetch"):
        assert f" {command} " in found.stdout


def test_info_agrees_with_the_figures_of_the_reference_shapes(workplace, reference_data, capsys, monkeypatch):
    monkeypatch.setenv("LANDING_REFERENCE_DATA", str(reference_data.resolve()))
    monkeypatch.chdir(workplace)
    expected = {
        ("bennu_radar_1348", "246"): {"c20": -0.03922, "c22": 0.003742, "equilateral_height_m": 21.4},
        ("bacchus_radar_2048", "1000"): {
            "c20": -0.02674,
            "c22": 0.01313,
            "s22": -0.00045,
            "dipole_mass_fraction": 0.437,
            "dipole_separation_m": 463.1,
            "mean_edge_m": 30.6,
        },
        ("eros_near_3897", "16000"): {
            "c20": -0.1185,
            "c22": 0.0539,
            "s22": -0.0182,
            "long_axis_dipole_mass_fraction": 0.528,
            "long_axis_dipole_separation_m": 15364.0,
            "longest_edge_m": 853.0,
        },
    }
    for (name, radius), figures in expected.items():
        code, out, _ = run(capsys, "info", name, "--reference-radius", radius, "--json")
        found = json.loads(out)
        assert code == 0
        for key, value in figures.items():
            np.testing.assert_allclose(found[key], value, rtol=0.012 if key == "s22" else 2e-3, err_msg=key)
