"""What is exported holds the file's numbers, under the file's names, in formats that others read."""

from __future__ import annotations

import base64
import csv
import dataclasses
import io
import json
import struct
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from test_store import make_run

from landing_cli.errors import InputRefused
from landing_cli.flight.trajectory import Trajectory
from landing_cli.reach.exports import export_map, export_table, facets_table
from landing_cli.reach.records import FACET_COLUMNS
from landing_cli.reach.stored import ReachRun
from landing_cli.results.maps import on_every_facet, to_ply
from landing_cli.results.oem import to_oem
from landing_cli.results.tables import to_csv, trajectory_table
from landing_cli.results.tree import Dataset, Group

CASE = "pole_700s"


@pytest.fixture(scope="module")
def run() -> ReachRun:
    return make_run()


@pytest.fixture(scope="module")
def flight() -> Trajectory:
    rng = np.random.default_rng(0)
    return Trajectory(
        np.arange(5.0), *(rng.normal(size=(5, 3)) for _ in range(2)), np.full(5, 2000.0), np.zeros((5, 3))
    )


def test_csv_reads_back_to_the_same_bits(run: ReachRun) -> None:
    lines = list(csv.DictReader(io.StringIO(export_table(run, "facets", "csv", CASE))))
    rows = run.cases[1].solutions.rows
    assert [int(line["facet"]) for line in lines] == rows["facet"].tolist()
    np.testing.assert_array_equal(
        [float(line["performance_index_m2_s3"]) for line in lines], rows["performance_index_m2_s3"]
    )
    np.testing.assert_array_equal([float(line["costates_vy"]) for line in lines], rows["costates"][:, 4])


def test_csv_has_the_columns_of_the_file_in_their_order_and_verdicts_in_words(run: ReachRun) -> None:
    text = export_table(run, "facets", "csv", CASE)
    names = text.splitlines()[0].split(",")
    stems = [c.name for c in FACET_COLUMNS if not c.shape]
    assert [name for name in names if name in stems] == stems
    assert names[0] == "facet"
    assert [n for n in names if n.startswith("handover_position_m")] == [
        f"handover_position_m_{c}" for c in "xyz"
    ]
    verdicts = {line.split(",")[1] for line in text.splitlines()[1:]}
    assert verdicts <= {"reachable", "unreachable", "unresolved"}
    assert len(verdicts) == 3


def test_json_is_strict_and_says_null_where_no_number_exists(run: ReachRun) -> None:
    rows = json.loads(export_table(run, "facets", "json", CASE), parse_constant=pytest.fail)
    assert rows[1]["performance_index_m2_s3"] is None
    assert rows[0]["performance_index_m2_s3"] == run.cases[1].solutions.rows["performance_index_m2_s3"][0]


def test_several_cases_stand_below_each_other(run: ReachRun) -> None:
    lines = list(csv.DictReader(io.StringIO(export_table(run, "facets", "csv"))))
    assert [line["case"] for line in lines] == ["pole_900s"] * 12 + ["pole_700s"] * 12


def test_the_summary_is_one_row_a_case_with_inner_values_flattened(run: ReachRun) -> None:
    rows = json.loads(export_table(run, "summary", "json"))
    assert [row["case"] for row in rows] == ["pole_900s", "pole_700s"]
    assert rows[0]["delta_v_m_s_max"] == 2.5
    assert rows[0]["delta_v_m_s_median"] is None


def test_the_boundary_is_exported_where_there_is_one(run: ReachRun) -> None:
    assert export_table(run, "boundary", "csv", CASE) == "facet\n0\n1\n2\n"
    with pytest.raises(InputRefused, match="traced no boundary"):
        export_table(run, "boundary", "csv", "pole_900s")


def test_a_section_s_lists_stand_below_each_other(run: ReachRun) -> None:
    lists = {"section": [4, 5, 6], "ring": [7], "expansion": [], "boundary": [1, 2]}
    members: dict[str, Dataset | Group] = {
        f"{name}_facets": Dataset(np.array(facets, dtype=np.int32), "1", "facets", (f"{name}_point",))
        for name, facets in lists.items()
    }
    members["domain"] = Dataset(np.eye(12, dtype=np.uint8)[3], "1", "1 inside", ("surface",))
    case = dataclasses.replace(run.cases[1], boundary=Group(members))
    text = export_table(ReachRun((case,)), "boundary", "csv", CASE)
    parts = ["section,4", "section,5", "section,6", "ring,7", "boundary,1", "boundary,2", "domain,3"]
    assert text.splitlines() == ["part,facet", *parts]
    with pytest.raises(InputRefused, match="pole_900s has other columns than that of pole_700s"):
        other = dataclasses.replace(run.cases[0], boundary=run.cases[1].boundary)
        export_table(ReachRun((case, other)), "boundary", "csv")


def test_wrong_choices_are_refused_with_the_right_ones(run: ReachRun) -> None:
    with pytest.raises(InputRefused, match="pole_900s, pole_700s"):
        export_table(run, "facets", "csv", "pole_800s")
    with pytest.raises(InputRefused, match="csv or json"):
        export_table(run, "facets", "xlsx")
    with pytest.raises(InputRefused, match="no table"):
        export_table(run, "orbits", "csv")
    with pytest.raises(InputRefused, match="one case"):
        export_map(run, "ply")
    with pytest.raises(InputRefused, match="ply, vtp, obj"):
        export_map(run, "stl", CASE)


def test_a_trajectory_is_a_table_of_time_state_mass_and_thrust(flight: Trajectory) -> None:
    names = to_csv(trajectory_table(flight)).splitlines()[0]
    vectors = ",".join(f"{v}_{c}" for v in ("position_m", "velocity_m_s", "thrust_n") for c in "xyz")
    assert names == f"t_s,{vectors},mass_kg"


def test_ply_is_read_by_trimesh_with_its_colours(run: ReachRun) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.load(io.BytesIO(export_map(run, "ply", CASE)), file_type="ply", process=False)
    np.testing.assert_array_equal(mesh.vertices, run.asteroid.mesh.vertices)
    np.testing.assert_array_equal(mesh.faces, run.asteroid.mesh.faces)
    data = mesh.metadata["_ply_raw"]["face"]["data"]
    np.testing.assert_array_equal(data["fuel_kg"].ravel(), run.cases[1].solutions.rows["fuel_kg"])
    reachable = run.cases[1].solutions.rows["verdict"] == 1
    assert (mesh.visual.face_colors[reachable][:, :3] == (0, 114, 178)).all()


def test_vtp_holds_every_column_as_cell_data(run: ReachRun) -> None:
    root = ET.fromstring(export_map(run, "vtp", CASE))
    arrays = {a.get("Name"): a for a in root.iter("DataArray")}
    table = on_every_facet(facets_table(run.cases[1]), 12)
    assert set(table.columns) | {"position_m", "connectivity", "offsets"} == set(arrays)
    raw = base64.b64decode(arrays["performance_index_m2_s3"].text or "")
    assert struct.unpack("<Q", raw[:8]) == (12 * 8,)
    np.testing.assert_array_equal(
        np.frombuffer(raw[8:], "<f8"), run.cases[1].solutions.rows["performance_index_m2_s3"]
    )
    assert arrays["verdict"].get("type") == "UInt8"
    np.testing.assert_array_equal(
        np.frombuffer(base64.b64decode(arrays["offsets"].text or "")[8:], "<i8"), np.arange(3, 37, 3)
    )


def test_obj_keeps_the_facets_in_order_and_groups_them_by_verdict(run: ReachRun) -> None:
    group, faces, groups = "", [], []
    for line in export_map(run, "obj", CASE).decode().splitlines():
        kind, *rest = line.split()
        if kind == "g":
            group = rest[0]
        elif kind == "f":
            faces.append([int(v) - 1 for v in rest])
            groups.append(group)
    np.testing.assert_array_equal(faces, run.asteroid.mesh.faces)
    words = facets_table(run.cases[1]).columns["verdict"].cells()
    assert groups == words


def test_facets_that_a_method_did_not_ask_are_blank_on_the_map(run: ReachRun) -> None:
    table = facets_table(run.cases[1])
    few = type(table)({n: type(c)(c.values[3:5], c.flags) for n, c in table.columns.items()})
    spread = on_every_facet(few, 12).columns
    assert np.isnan(spread["fuel_kg"].values[[0, 11]]).all()
    assert spread["iterations"].values[3] == run.cases[1].solutions.rows["iterations"][3]
    assert spread["verdict"].values[0] == 0
    assert len(to_ply(run.asteroid.mesh, on_every_facet(few, 12))) > 0


def test_an_oem_names_its_frame_and_epoch_and_reads_back(flight: Trajectory) -> None:
    text = to_oem(flight, "bennu", "lander", "2030-05-01T12:00:00", "2026-01-01T00:00:00+00:00")
    lines = text.splitlines()
    assert lines[0] == "CCSDS_OEM_VERS = 2.0"
    facts = dict(line.split(" = ") for line in lines if " = " in line)
    assert facts["REF_FRAME"] == "BENNU_FIXED"
    assert facts["START_TIME"] == "2030-05-01T12:00:00.000000"
    assert facts["STOP_TIME"] == "2030-05-01T12:00:04.000000"
    states = [line.split() for line in lines if line.startswith("2030-")]
    numbers = np.array([state[1:] for state in states], dtype=float) * 1e3
    np.testing.assert_allclose(numbers[:, :3], flight.position_m, rtol=0, atol=1e-8)
    np.testing.assert_allclose(numbers[:, 3:], flight.velocity_m_s, rtol=0, atol=1e-11)
    with pytest.raises(InputRefused, match="epoch"):
        to_oem(flight, "bennu", "lander", None, "2026-01-01")
    with pytest.raises(InputRefused, match="ISO 8601"):
        to_oem(flight, "bennu", "lander", "tomorrow", "2026-01-01")
