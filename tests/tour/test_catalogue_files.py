"""Catalogues: three formats, one answer; what is bad is named; the reference list is read whole and fast."""

from __future__ import annotations

import gzip
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest

from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import AU_M
from landing_cli.sources.catalogue_files import read_catalogue
from landing_cli.sources.packed_designations import unpack_designation, unpack_epoch
from landing_cli.tour.targets import embedded_catalogue

REFERENCE = (
    Path(os.environ.get("LANDING_REFERENCE_DATA", Path(__file__).parents[3] / "shared"))
    / "catalog"
    / "NEA_2019.txt.gz"
)
EROS = (
    "00433   11.16  0.46 K1972  84.17190  178.83549  304.30424   10.82858  0.2227385  0.55973997   1.4581823"
    "  0 MPO467611  8406  52 1893-2019 0.69 M-v 38h MPCLINUX   1804    (433) Eros               20190509"
)
QE = (
    "K18Q00E 27.7   0.15 K1972 188.82668  249.43723  107.71562    0.18289  0.2468297  0.65450000   1.3138048"
    "  6 MPO000000    40   1    3 days 0.46 M-v 3Eh MPCALB     2803          2018 QE            20180919"
)
EROS_CSV = "433,433 Eros (A898 PA),2458666.5,1.4581823,.2227385,10.82858,304.30424,178.83549,84.17190,11.16,0"
CSV_HEADER = "pdes,full_name,epoch,a,e,i,om,w,ma,H,condition_code"
EROS_JSON = {
    "Number": "(433)",
    "Name": "Eros",
    "Principal_desig": "1898 DQ",
    "H": 11.16,
    "Epoch": 2458666.5,
    "M": 84.17190,
    "Peri": 178.83549,
    "Node": 304.30424,
    "i": 10.82858,
    "e": 0.2227385,
    "a": 1.4581823,
    "U": "0",
}


@pytest.mark.parametrize(
    ("packed", "unpacked", "numbered"),
    [
        ("K14N64Q", "2014 NQ64", False),
        ("K18Q00E", "2018 QE", False),
        ("F4276", "154276", True),
        ("j2807", "452807", True),
        ("z9999", "619999", True),
        ("~0000", "620000", True),
        ("~zzzz", "15396335", True),
        ("J95X00A", "1995 XA", False),
        ("J98SA8Q", "1998 SQ108", False),
        ("K07Tf8A", "2007 TA418", False),
        ("_QC0000", "2026 CA620", False),
        ("_QC0aEM", "2026 CZ6190", False),
        ("_QCzzzz", "2026 CL591673", False),
        ("PLS2040", "2040 P-L", False),
        ("T3S4101", "4101 T-3", False),
    ],
)
def test_designations_of_the_minor_planet_center_and_the_note(
    packed: str, unpacked: str, numbered: bool
) -> None:
    assert unpack_designation(packed) == (unpacked, numbered)


@pytest.mark.parametrize(
    "packed", ["", "2018 QE", "K18I00E", "K18Q00I", "K18QE", "K18Q00", "K18Qx0", "12.45"]
)
def test_what_is_no_designation(packed: str) -> None:
    assert unpack_designation(packed) is None


@pytest.mark.parametrize(
    ("packed", "jd"),
    [
        ("K1972", 2458666.5),
        ("J9611", 2450083.5),
        ("J961A", 2450092.5),
        ("J969U", 2450356.5),
        ("K25BL", 2461000.5),
    ],
)
def test_packed_epochs(packed: str, jd: float) -> None:
    assert unpack_epoch(packed) == jd


@pytest.mark.parametrize("packed", ["K192V", "K19D1", "K1970", "K197", "X1972", "     "])
def test_what_is_no_epoch(packed: str) -> None:
    assert unpack_epoch(packed) is None


def write(path: Path, text: str) -> Path:
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


FORMS = {
    "NEA.txt": EROS + "\n",
    "NEA.txt.gz": EROS + "\n",
    "MPCORB.DAT": f"MINOR PLANET CENTER ORBIT DATABASE\n\nabout, a, b, c, d, e, f\n{'-' * 160}\n{EROS}\n\n",
    "crlf.txt": EROS + "\r\n",
    "nea.json": json.dumps([EROS_JSON]),
    "nea.json.gz": json.dumps([EROS_JSON]),
    "sbdb.csv": f"{CSV_HEADER}\n{EROS_CSV}\n",
    "bom.csv": f"\ufeff# from JPL\n{CSV_HEADER}\n{EROS_CSV}\n",
    "full_name.csv": f"{CSV_HEADER[5:]}\n{EROS_CSV[4:]}\n",
}


@pytest.mark.parametrize("name", FORMS)
def test_every_form_gives_the_same_orbit(tmp_path: Path, name: str) -> None:
    read = read_catalogue(write(tmp_path / name, FORMS[name]))
    assert read.designations == ("433",)
    assert read.bad_rows == ()
    assert read.numbered.tolist() == [True]
    assert read.condition_code.tolist() == [0]
    assert read.absolute_magnitude.tolist() == [11.16]
    orbit = read.elements
    assert orbit.epoch_t_s[0] == (2458666.5 - 2451545.0) * 86400.0
    assert orbit.a_m[0] == pytest.approx(1.4581823 * AU_M, rel=1e-15)
    assert orbit.e[0] == 0.2227385
    angles = (orbit.inclination_rad, orbit.node_rad, orbit.argument_rad, orbit.mean_anomaly_rad)
    degrees = [math.degrees(angle[0]) for angle in angles]
    np.testing.assert_allclose(degrees, [10.82858, 304.30424, 178.83549, 84.17190], rtol=1e-14)


def test_a_csv_may_give_perihelion_and_modified_julian_date(tmp_path: Path) -> None:
    text = "pdes,epoch_mjd,q,e,i,om,w,ma\n433,58666,1.2,.2,10,304,178,84\n"
    read = read_catalogue(write(tmp_path / "x.csv", text))
    assert read.elements.a_m[0] == pytest.approx(1.5 * AU_M, rel=1e-15)
    assert read.elements.epoch_t_s[0] == (2458666.5 - 2451545.0) * 86400.0
    assert math.isnan(read.absolute_magnitude[0])
    assert read.condition_code[0] == -1


BAD_LINES = {
    "short": (QE[:60] + "  ", "has 57 characters, fewer than 103"),
    "designation": ("K18I00E" + QE[7:], "'K18I00E' is no packed designation"),
    "epoch": (QE.replace("K1972", "K192V"), "2018 QE: 'K192V' is no packed epoch"),
    "letters": (QE.replace("0.2468297", "0.24nan97"), "2018 QE: an element is no decimal number"),
    "underscore": (QE.replace("188.82668", "188_82668"), "2018 QE: an element is no decimal number"),
    "blank": (QE.replace("188.82668", "         "), "2018 QE: an element is missing or no decimal number"),
    "negative e": (QE.replace(" 0.2468297", "-0.2468297"), "the eccentricity is -0.24683"),
    "inclination": (QE.replace("  0.18289", "190.18289"), "the inclination is 190.183 degrees"),
    "zero a": (QE.replace("1.3138048", "0.0000000"), "the semi-major axis is 0"),
    "twice": (EROS, "433 stands in line 1 already"),
}


@pytest.mark.parametrize("name", BAD_LINES)
def test_a_bad_row_is_named_and_the_rest_is_read(tmp_path: Path, name: str) -> None:
    line, reason = BAD_LINES[name]
    other = QE.replace("K18Q00E", "K19Q00E")
    read = read_catalogue(write(tmp_path / "x.txt", f"{EROS}\n{line}\n{other}\n"))
    assert read.designations == ("433", "2019 QE")
    assert [(row.line, row.reason) for row in read.bad_rows] == [(2, reason)]


REFUSED = {
    "empty": ("", "is empty"),
    "binary": ("\0\1\2", "is no text; give a catalogue, plain or gzipped"),
    "prose": ("hello\nworld\n", "2 of 2 rows are bad (line 1: has 5 characters, fewer than 103"),
    "hyperbolic": (
        EROS.replace("0.2227385", "1.2227385"),
        "line 1: 433 has e = 1.22274, a = 1.45818 au: no closed orbit",
    ),
    "csv among fixed": (f"{EROS}\n{EROS_CSV}\n", "line 2: is CSV, the lines before are fixed width"),
    "json among fixed": (f'{EROS}\n{{"a": 1}}\n', "line 2: is JSON, the lines before are fixed width"),
    "fixed among csv": (f"{CSV_HEADER}\n{EROS_CSV}\n{EROS}\n", "line 3: is no CSV"),
    "csv column": ("pdes,epoch,a,e,i,om,ma\n", "line 1: the CSV header has no column w"),
    "csv twice": (f"{CSV_HEADER},H\n{EROS_CSV},3\n", "line 1: the CSV header names H twice"),
    "csv no rows": (CSV_HEADER + "\n", "holds no objects"),
    "hyperbolic csv": (
        f"# c\n{CSV_HEADER}\n{EROS_CSV.replace('.2227385', '1.01')}\n",
        "line 3: 433 has e = 1.01, a = 1.45818 au",
    ),
    "json broken": ('[{"a": 1', "is no JSON"),
    "json object": ('{"a": 1}', "is a JSON object, not the MPC's list of objects"),
    "json deep": ("[" * 100_000, "is no JSON"),
    "json strings": (
        '[{"Number": "(4)", "a": "2"}]',
        "1 of 1 rows are bad (entry 1: 4: Epoch, a, e, i, Node, Peri, M",
    ),
    "json hyperbolic": (json.dumps([EROS_JSON | {"e": 1.2}]), "entry 1: 433 has e = 1.2"),
    "json nan": (json.dumps([EROS_JSON | {"a": math.nan}]), "entry 1: 433: a missing or no number"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_catalogue_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    text, message = REFUSED[name]
    path = write(tmp_path / "x.txt", text)
    with pytest.raises(InputRefused) as caught:
        read_catalogue(path)
    told = str(caught.value)
    assert told.startswith(str(path))
    assert message in told
    assert "\n" not in told


def test_a_torn_archive_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.gz"
    path.write_bytes(gzip.compress(EROS.encode() * 50)[:-20])
    with pytest.raises(InputRefused, match="is no whole gzip file"):
        read_catalogue(path)


@pytest.mark.skipif(not REFERENCE.is_file(), reason="the reference catalogue is not here")
def test_the_reference_list_is_read_whole_and_agrees_with_the_embedded_targets() -> None:
    read = read_catalogue(REFERENCE)
    assert len(read) == 20_060
    assert read.bad_rows == ()
    perihelion = read.elements.a_m * (1.0 - read.elements.e) / AU_M
    assert int((perihelion < 1.2).sum()) == 18_180
    assert int((read.numbered & (perihelion < 1.2)).sum()) == 2_488
    place = {name: i for i, name in enumerate(read.designations)}
    ten = embedded_catalogue()
    assert len(ten) == 10
    for i, name in enumerate(ten.designations):
        if name == "2014 NQ64":  # its elements are of another epoch
            continue
        j = place[name]
        ours, theirs = ten.elements, read.elements
        np.testing.assert_allclose(ours.epoch_t_s[i], theirs.epoch_t_s[j], rtol=0)
        for key in ("a_m", "e", "inclination_rad", "node_rad", "argument_rad", "mean_anomaly_rad"):
            np.testing.assert_allclose(getattr(ours, key)[i], getattr(theirs, key)[j], rtol=1e-12)
        assert ten.absolute_magnitude[i] == read.absolute_magnitude[j]
