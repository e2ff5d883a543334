"""Every leaf of every shipped scenario, damaged in every way: exit 3, the dotted key, nothing left behind."""

from __future__ import annotations

import io
import json
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from programs import ROOT, Tally

from landing_cli.cli.guard import told
from landing_cli.cli.scenario import check
from landing_cli.errors import ExitCode
from landing_cli.scenario.document import parse

SHIPPED = sorted((ROOT / "configs").glob("**/*.yaml"))

MISSING, MISSPELT = object(), object()
# values that may have either sign, those that may be zero, and keys that may be left out
SIGNED = (
    "position_km",
    "position_m",
    "site_position_m",
    "velocity_m_s",
    "acceleration_m_s2",
    "azimuth_deg",
    "sun_direction",
    "control_points_m",
    "sun_angle_deg",
    "radial_speed_m_s",
)
ZERO = (
    "facet",
    "clearance_m",
    "clearance_free_m",
    "rotation_rate_rad_s",
    "seed",
    "acceleration_noise_m2_s3",
    "weight",
    "revolutions_max",
    "first_burn_wait_d",
    "position_sigma_m",
    "velocity_sigma_m_s",
    "mass_sigma_relative",
    "thrust_sigma_relative",
    "gm_sigma_relative",
)
# lists that stay valid with an element less
SHORTER = ("tof_s", "waypoints", "weight", "exclude")
OPTIONAL = (
    "length_unit",
    "origin",
    "degree",
    "reference_radius_m",
    "propellant_kg",
    "velocity_m_s",
    "ellipsoid_m",
    "glide_slope_half_angle_deg",
    "handover",
    "descent",
    "final_stage_thrust",
    "final_stage_compared_s",
    "margin",
    "method",
    "h_m",
    "azimuth_deg",
    "rotation_rate_rad_s",  # without it the message asks for the period
    "acceleration_m_s2",
    "clearance_m",
    "clearance",
    "cone_half_angle_deg",
    "mass_model",
    "longitudes",
    # of an observation
    "frame",
    "gravity",
    "clearance_free_m",
    "clusters",
    "mean_per_cluster",
    "spread_m",
    "extent_m",
    "boresight",
    "range_max_m",
    "emission_max_deg",
    "incidence_max_deg",
    "acceleration_noise_m2_s3",
    "timing",
    "nodes",
    "knots",
    # of an isochrone study
    "tof_min_s",
    "tof_max_s",
    "step_s",
    "tolerance_s",
    # of a dispersion
    "axes",
    "position_sigma_m",
    "velocity_sigma_m_s",
    "mass_sigma_relative",
    "thrust_sigma_relative",
    "gm_sigma_relative",
    # of a tour
    "catalogue",
    "perihelion_max_au",
    "exclude",
    "albedo",
    "asteroids_max",
    "revolutions_max",
    "first_burn_wait_d",
    "beam",
    "time_step_d",
    "branches",
    "kept_chains",
    "coast_distance_max_km",
    "k1",
    "k2",
    "k3",
)
Path_ = tuple[str | int, ...]


def leaves(node: Any, path: Path_ = ()) -> Iterator[tuple[Path_, Any]]:
    if isinstance(node, dict):
        for key, value in node.items():
            yield from leaves(value, (*path, key))
    elif isinstance(node, list):
        for index, value in enumerate(node):
            yield from leaves(value, (*path, index))
    else:
        yield path, node


def mutations(path: Path_, value: Any) -> Iterator[tuple[str, Any]]:
    named = next(part for part in reversed(path) if isinstance(part, str))
    in_list = isinstance(path[-1], int)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    yield "nan", "@.nan@"
    yield "infinite", "@-.inf@"
    yield "list", [[value]]
    yield "section", {"x": value}
    if number:
        yield "text", "plenty"
        yield "yes", True
        yield "huge", 1e300
        yield "sexagesimal", "4:17"
    else:
        yield "number", 3.5
        yield "misspelt value", f"{value}?"
    if number and value > 0 and named not in SIGNED:
        yield "sign", -value
        if named not in ZERO:
            yield "zero", 0
    if not in_list:
        yield "misspelt", MISSPELT
    if not in_list and named not in OPTIONAL:
        yield "empty", None
        yield "missing", MISSING
    if in_list and named not in SHORTER:
        yield "missing", MISSING


def mutated(tree: Any, path: Path_, change: Any) -> Any:
    tree = json.loads(json.dumps(tree))
    node = tree
    for part in path[:-1]:
        node = node[part]
    if change is MISSING:
        del node[path[-1]]
    elif change is MISSPELT:
        node[f"{path[-1]}_"] = node.pop(path[-1])
    else:
        node[path[-1]] = change
    return tree


def as_yaml(tree: Any) -> str:
    """One key a line, as people write it; JSON is YAML but for NaN."""
    return json.dumps(tree, indent=1).replace('"@', "").replace('@"', "")


def _checked(_: Sequence[str]) -> int:
    """What `landing scenario check damaged.yaml --quiet` does once its arguments are parsed."""
    check("damaged.yaml", quiet=True)
    return ExitCode.OK


def damage_scenario(source: Path) -> Tally:
    """Damage one scenario, leaf by leaf, and check each."""
    tally = Tally(f"leaves of {source.stem} damaged")
    tree = parse(source.read_text(), source.name).tree
    with tempfile.TemporaryDirectory(prefix="damaged-") as folder, chdir(folder):
        for beside in source.parent.glob("*.csv"):
            shutil.copy(beside, folder)
        Path("damaged.yaml").write_text(as_yaml(tree))
        shapeless = ": body.shape:" in "".join(_complaints(": body.shape"))
        for path, value in leaves(tree):
            for kind, change in mutations(path, value):
                if shapeless and path[-1] == "file" and kind == "misspelt value":
                    continue  # nobody looks for landmarks of a shape that is not there
                Path("damaged.yaml").write_text(as_yaml(mutated(tree, path, change)))
                # what is wrong with a list's element may be told at the list
                key = ".".join(map(str, path[:-1] if isinstance(path[-1], int) else path))
                tally.record(f"{kind} at {key}", _complaints(key))
    return tally


def _complaints(key: str) -> list[str]:
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        code = told(_checked, [])
    text = err.getvalue()
    wrong = [f"exit {code}"] if code != ExitCode.REFUSED else []
    wrong += [f"does not say {what!r}" for what in (f": {key}", "damaged.yaml:") if what not in text]
    wrong += [f"says {what!r}" for what in ("Traceback", "unexpected") if what in text]
    wrong += ["printed something"] if out.getvalue() else []
    wrong += (
        ["left something behind"]
        if [p for p in Path().iterdir() if p.name != "damaged.yaml" and p.suffix != ".csv"]
        else []
    )
    return [*wrong, f"told {text.strip()!r}"] if wrong else []
