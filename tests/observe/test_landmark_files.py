"""Lists of landmarks: what is read, and what is refused with its line."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from landing_cli.errors import InputRefused
from landing_cli.scenario.landmark_document import read_landmarks
from landing_cli.sources.landmark_files import read_landmark_csv


def written(folder: Path, text: str | bytes, name: str = "marks.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_positions_in_any_order_of_columns(tmp_path):
    text = '\ufeff# craters\r\nname, z_km,y_km ,x_km,diameter_m\r\n\r\n"a, b",1,-2.5,3e0,12\r\nc,0,0,-.5,\r\n'
    path = written(tmp_path, text)
    found = read_landmark_csv(path)
    np.testing.assert_array_equal(found.position_m, [[3000.0, -2500.0, 1000.0], [-500.0, 0.0, 0.0]])
    np.testing.assert_array_equal(found.diameter_m, [12.0, np.nan])
    assert found.name == ("a, b", "c")
    assert found.where == (f"{path}, line 4", f"{path}, line 5")
    assert np.isnan(found.longitude_rad).all()
    assert found.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_directions_without_names(tmp_path):
    found = read_landmarks(written(tmp_path, "lon_deg,lat_deg\n270,-45\n-90,45\n"))
    np.testing.assert_allclose(found.longitude_rad, [1.5 * np.pi, -0.5 * np.pi], rtol=1e-15)
    np.testing.assert_allclose(found.latitude_rad, [-0.25 * np.pi, 0.25 * np.pi], rtol=1e-15)
    assert np.isnan(found.position_m).all() and found.name == ("L001", "L002")


def test_yaml_says_the_same_as_csv(tmp_path):
    text = """\
landmarks:
  - {name: a, position_km: [3, -2.5, 1], diameter_m: 12}
  - position_m: [-500, 0, 0]
  - lon_deg: 270
    lat_deg: -45.0
    name: "3"
"""
    path = written(tmp_path, text, "marks.yaml")
    found = read_landmarks(path)
    np.testing.assert_array_equal(found.position_m[:2], [[3000.0, -2500.0, 1000.0], [-500.0, 0.0, 0.0]])
    assert np.isnan(found.position_m[2]).all()
    np.testing.assert_allclose([found.longitude_rad[2], found.latitude_rad[2]], [1.5 * np.pi, -0.25 * np.pi])
    assert found.name == ("a", "L002", "3")
    np.testing.assert_array_equal(found.diameter_m, [12.0, np.nan, np.nan])
    assert found.where == (f"{path}:2", f"{path}:3", f"{path}:4")
    assert found.sha256 == hashlib.sha256(text.encode()).hexdigest()


HEAD = "x_m,y_m,z_m"
CSV_FAULTS = {
    "empty": ("", "does not say where landmarks are in one way"),
    "no rows": (f"{HEAD}\n", "lists no landmark"),
    "no header": ("1,2,3\n", "line 1: '1' is no column of landmarks"),
    "unknown column": (f"{HEAD},size\n1,2,3,4\n", "line 1: 'size' is no column"),
    "two units": ("x_m,y_m,z_km\n1,2,3\n", "line 1: does not say where"),
    "two ways": (f"{HEAD},lon_deg,lat_deg\n1,2,3,4,5\n", "line 1: does not say where"),
    "half a place": ("x_m,y_m\n1,2\n", "line 1: does not say where"),
    "column twice": (f"{HEAD},x_m\n1,2,3,4\n", "line 1: names the column 'x_m' twice"),
    "semicolons": ("x_m;y_m;z_m\n1;2;3\n", "line 1: columns are not separated by commas"),
    "short row": (f"{HEAD}\n1,2,3\n1,2\n", "line 3: has 2 cells where 3 columns"),
    "long row": (f"{HEAD}\n1,2,3,\n", "line 2: has 4 cells where 3 columns"),
    "word": (f"{HEAD}\n1,two,3\n", "line 2: y_m: 'two' is no finite decimal number"),
    "not a number": (f"{HEAD}\n1,nan,3\n", "line 2: y_m: 'nan' is no finite"),
    "infinity": (f"{HEAD}\n1,inf,3\n", "line 2: y_m: 'inf' is no finite"),
    "underscore": (f"{HEAD}\n1_0,2,3\n", "line 2: x_m: '1_0' is no finite"),
    "other digits": (f"{HEAD}\n\u0661,2,3\n", "line 2: x_m: '\u0661' is no finite"),
    "empty cell": (f"{HEAD}\n1,,3\n", "line 2: y_m: '' is no finite"),
    "overflow": (f"{HEAD}\n1e999,2,3\n", "line 2: the position is a million km away"),
    "too far": (f"{HEAD}\n1e10,2,3\n", "line 2: the position is a million km away"),
    "latitude": ("lon_deg,lat_deg\n10,90.1\n", "line 2: lat_deg: 90.1 is not within"),
    "longitude": ("lon_deg,lat_deg\n361,9\n", "line 2: lon_deg: 361 is not within"),
    "diameter": (f"{HEAD},diameter_m\n1,2,3,0\n", "line 2: diameter_m: 0 is no diameter"),
    "name twice": (f"name,{HEAD}\na,1,2,3\nb,1,2,4\na,1,2,5\n", "line 4: gives the name of another landmark"),
    "made name twice": (f"name,{HEAD}\nL002,1,2,3\n,1,2,4\n", "line 3: gives the name of another landmark"),
    "place twice": (f"{HEAD}\n1,2,3\n1.0,2,3\n", "line 3: gives the place of another landmark"),
    "long name": (f"name,{HEAD}\n{'a' * 101},1,2,3\n", "line 2: the name is too long"),
    "control in name": (f"name,{HEAD}\na\x07b,1,2,3\n", "line 2: the name is too long or holds control"),
    "zero byte": (f"{HEAD}\n1,2,3\0\n", "line 2: holds a control character"),
    "open quote": (f'name,{HEAD}\n"a,1,2,3\n', "line 2: is no CSV"),
    "not text": (b"x_m,y_m,z_m\n1,2,\xff\n", "line 2: byte 0xff is not UTF-8"),
}


@pytest.mark.parametrize("fault", CSV_FAULTS)
def test_faults_of_a_csv_are_told_with_their_line(tmp_path, fault):
    text, told = CSV_FAULTS[fault]
    path = written(tmp_path, text)
    with pytest.raises(InputRefused) as refused:
        read_landmarks(path)
    assert str(refused.value).startswith(str(path))
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


YAML_FAULTS = {
    "no list": ("marks: []", "is not one list named landmarks"),
    "more keys": ("landmarks: []\nunit: km", "is not one list named landmarks"),
    "empty list": ("landmarks: []", "lists no landmark"),
    "a number": ("landmarks:\n  - 4", ":2: a landmark is no mapping"),
    "unknown key": ("landmarks:\n  - {x: 4}", ":2: 'x' is no key of a landmark"),
    "no place": ("landmarks:\n  - {name: a}", ":2: does not say where it is in one way"),
    "two places": (
        "landmarks:\n  - {position_m: [1, 2, 3], lon_deg: 3, lat_deg: 4}",
        ":2: does not say where it is in one way",
    ),
    "two units": ("landmarks:\n  - {position_m: [1, 2, 3], position_km: [1, 2, 3]}", ":2: does not say"),
    "half a direction": ("landmarks:\n  - {lon_deg: 3}", ":2: does not say where it is in one way"),
    "half more": ("landmarks:\n  - {position_m: [1, 2, 3], lon_deg: 3}", ":2: does not say where"),
    "two numbers": ("landmarks:\n  - {position_m: [1, 2]}", ":2: position_m: is no list of three numbers"),
    "text": ("landmarks:\n  - {position_m: [1, 2, x]}", ":2: position_m: 'x' is no number"),
    "truth": ("landmarks:\n  - {lon_deg: true, lat_deg: 3}", ":2: lon_deg: 'True' is no number"),
    "number as name": ("landmarks:\n  - {name: 4, position_m: [1, 2, 3]}", ":2: name: '4' is no text"),
    "alias": ("landmarks:\n  - &a {position_m: [1, 2, 3]}\n  - *a", "anchors and aliases"),
    "infinite": ("landmarks:\n  - {position_m: [.inf, 2, 3]}", ".inf is not a finite number"),
    "no yaml": ("landmarks: [", "not readable as YAML"),
}


@pytest.mark.parametrize("fault", YAML_FAULTS)
def test_faults_of_a_yaml_are_told_with_their_line(tmp_path, fault):
    text, told = YAML_FAULTS[fault]
    path = written(tmp_path, text, "marks.yaml")
    with pytest.raises(InputRefused) as refused:
        read_landmarks(path)
    assert str(refused.value).startswith(str(path))
    assert told in str(refused.value)


def test_other_files_are_refused(tmp_path):
    with pytest.raises(InputRefused, match=r"does not end in \.txt; take \.csv or \.yaml"):
        read_landmarks(written(tmp_path, "", "marks.txt"))
    with pytest.raises(InputRefused, match="cannot be read: No such file"):
        read_landmarks(tmp_path / "none.csv")
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(InputRefused, match="is a directory"):
        read_landmarks(tmp_path / "folder.csv")


@pytest.mark.parametrize("kind", ["csv", "yaml"])
def test_mutilated_lists_are_read_or_refused_and_never_crash(tmp_path, kind):
    text = {
        "csv": 'name,x_m,y_m,z_m,diameter_m\na,1,2.5,-3e2,4\n"b, c",5,6,7,\n',
        "yaml": "landmarks:\n  - {name: a, position_m: [1, 2.5, -3e2], diameter_m: 4}\n"
        "  - {lon_deg: 5, lat_deg: 6}\n",
    }[kind]
    rng = np.random.default_rng(11)
    alphabet = b"0159.,-+eE:{}[]&*!|>\"'#\n\r\t\0 \xff\xc3\xa9naxmz_"
    refused = 0
    for _ in range(400):
        data = bytearray(text.encode())
        for _ in range(rng.integers(1, 4)):
            at, how = rng.integers(len(data)), rng.integers(3)
            piece = bytes([alphabet[rng.integers(len(alphabet))]])
            data[at : at + (how != 0)] = piece if how < 2 else b""
        try:
            table = read_landmarks(written(tmp_path, bytes(data), f"marks.{kind}"))
        except InputRefused as error:
            refused += 1
            assert "\n" not in str(error)
        else:
            placed = np.isfinite(table.position_m).all(axis=1) ^ np.isfinite(table.latitude_rad)
            assert placed.all() and len(set(table.name)) == len(table.name)
    assert 100 < refused < 400
