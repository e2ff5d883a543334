"""landing scenario: init, show, check, schema."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import pytest
from scenario_samples import MINIMAL, OCTAHEDRON, ROOT, write_minimal

from landing_cli.cli.app import main
from landing_cli.errors import ExitCode


@pytest.fixture(autouse=True)
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_what_init_writes_is_checked_clean(in_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main("landing", ["scenario", "init", "mine", "--shape", "bennu.obj"]) == 0
    assert (in_folder / "mine.yaml").read_text().startswith("# mine: a first scenario")
    assert main("landing", ["scenario", "check", "mine"]) == 0
    out, err = capsys.readouterr()
    assert "2692" in out
    assert "wrote mine.yaml" in err


def test_init_names_a_shape_of_the_user_relative_to_the_scenario(in_folder: Path) -> None:
    (in_folder / "models").mkdir()
    (in_folder / "models" / "rock.obj").write_text(OCTAHEDRON)
    (in_folder / "cases").mkdir()
    arguments = ["scenario", "init", "rock", "--shape", "models/rock.obj", "--length-unit", "m", "-q"]
    assert main("landing", arguments) == 0
    assert "shape: models/rock.obj " in (in_folder / "rock.yaml").read_text()
    assert main("landing", [*arguments, "-o", "cases/rock.yaml"]) == 0
    assert main("landing", ["scenario", "check", "cases/rock.yaml", "-q"]) == 0


def test_init_keeps_what_is_there_unless_forced(in_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (in_folder / "mine.yaml").write_text("precious")
    assert main("landing", ["scenario", "init", "mine", "--shape", "bennu.obj"]) == ExitCode.REFUSED
    assert (in_folder / "mine.yaml").read_text() == "precious"
    assert "mine.yaml: is there already; take another name, or --force" in capsys.readouterr().err
    assert main("landing", ["scenario", "init", "mine", "--shape", "bennu.obj", "--force"]) == 0
    assert (in_folder / "mine.yaml").read_text() != "precious"


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--shape", "nothing.obj"], "nothing.obj"),
        (["--shape", "bennu.obj", "--length-unit", "cm"], "body.length_unit: 'cm' is not allowed"),
        (["--shape", "bennu.obj", "--density", "-1"], "density_kg_m3: -1.0 is not more than 0"),
        (["--shape", "bennu.obj", "--period", "0"], "rotation_period_h: 0.0 is not at least 0.01"),
        (["--shape", "bennu.obj", "-o", "no/such/folder.yaml"], "no/such/folder.yaml: cannot be written"),
    ],
)
def test_init_refuses_and_leaves_nothing(
    in_folder: Path, extra: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main("landing", ["scenario", "init", "mine", *extra]) == ExitCode.REFUSED
    assert message in capsys.readouterr().err
    assert list(in_folder.iterdir()) == []


def test_show_prints_every_default_and_can_be_read_back(
    in_folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    write_minimal(in_folder)
    assert main("landing", ["scenario", "show", "probe", "--set", "reach.tof_s=800"]) == 0
    out, err = capsys.readouterr()
    assert err == "read probe.yaml\n"
    assert "tof_s: [800]" in out
    assert "glide_slope_half_angle_deg: 60" in out
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(out.encode())))
    assert main("landing", ["scenario", "show", "-"]) == 0
    assert capsys.readouterr().out == out


def test_json_of_show_and_check(in_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_minimal(in_folder)
    assert main("landing", ["scenario", "show", "probe", "--json", "-q"]) == 0
    assert json.loads(capsys.readouterr().out)["reach"]["final_stage_s"] == 200
    assert main("landing", ["scenario", "check", "probe", "--json", "-q"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert json.loads(out)["cases"] == ["top_700s", "top_900s"]


def test_check_finds_what_only_the_mesh_shows(in_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_minimal(in_folder, MINIMAL.replace("[0, 0, 900]", "[0, 0, 100]"))
    assert main("landing", ["scenario", "check", "probe"]) == ExitCode.REFUSED
    assert "probe.yaml:10: reach.initial_states.0.position_m: top begins inside" in capsys.readouterr().err


def test_schema_is_json_schema_that_forbids_unknown_keys(capsys: pytest.CaptureFixture[str]) -> None:
    assert main("landing", ["scenario", "schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    roots = [schema["$defs"][choice["$ref"].rpartition("/")[2]] for choice in schema["anyOf"]]
    assert all(root["additionalProperties"] is False for root in roots)
    assert "reach" in roots[0]["properties"]
    assert set(roots[1]["properties"]) == {"name", "tour"}


def test_shipped_scenarios_check_from_any_folder(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("bennu.yaml", "bacchus.yaml", "eros.yaml"):
        assert main("landing", ["scenario", "check", name]) == 0
        assert str(ROOT / "configs" / name) in capsys.readouterr().err
