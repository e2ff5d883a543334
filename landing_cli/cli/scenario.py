"""``landing scenario``: start, look at, check and describe scenario files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from landing_cli.cli import console
from landing_cli.cli.options import Force, Json, Output, Overrides, Quiet, ScenarioName, new_group
from landing_cli.errors import OutputRefused, UsageError

if TYPE_CHECKING:
    from landing_cli.scenario.build import Built
    from landing_cli.scenario.load import LoadedScenario, LoadedTour
    from landing_cli.scenario.schema import Scenario

app = new_group("Start, look at and check scenario files.")


@app.command()
def init(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the scenario.")],
    shape: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help="Shape file of the body: a path, or a name `landing shapes` lists."
        ),
    ] = None,
    tour: Annotated[
        bool, typer.Option("--tour", help="A tour of asteroids instead: without a body, without a shape.")
    ] = False,
    length_unit: Annotated[str, typer.Option(metavar="km|m", help="Unit of the shape file.")] = "km",
    density_kg_m3: Annotated[
        float, typer.Option("--density", metavar="KG_M3", help="Density assumed for the body.")
    ] = 2000.0,
    rotation_period_h: Annotated[float, typer.Option("--period", metavar="H", help="Rotation period.")] = 6.0,
    output: Output = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a commented scenario that runs as it is: NAME.yaml, for any body, or for a tour of asteroids.

    Of a body, start, thrust and times of flight follow from its size, the density and the period. Replace
    the numbers by your own.
    """
    path = output or Path(f"{name}.yaml")
    if tour == (shape is not None):
        raise UsageError("a scenario is of one body or of a tour", fix="give --shape FILE or --tour")
    if shape is None:
        from landing_cli.scenario.init_tour import tour_text

        text, command = tour_text(name), "tour search"
    else:
        from landing_cli.scenario.init import scenario_text

        text = scenario_text(name, shape, length_unit, density_kg_m3, rotation_period_h, path.parent)
        command = "reach run"
    _write_new(path, text, force)
    console.Console(quiet).say(f"wrote {path}; look it over, then: {command} {path}")


@app.command()
def show(
    scenario: ScenarioName, overrides: Overrides = None, as_json: Json = False, quiet: Quiet = False
) -> None:
    """Print a scenario with every default, as YAML that can be read back."""
    from landing_cli.scenario.load import load_any
    from landing_cli.scenario.schema import to_tree
    from landing_cli.scenario.show import to_yaml

    loaded = load_any(scenario, overrides or ())
    console.Console(quiet).say(f"read {loaded.source}")
    if as_json:
        console.print_json(to_tree(loaded.scenario))
    else:
        console.print_text(to_yaml(loaded.scenario))


@app.command()
def check(
    scenario: ScenarioName, overrides: Overrides = None, as_json: Json = False, quiet: Quiet = False
) -> None:
    """Check a scenario and its shape or catalogue, without solving anything."""
    from landing_cli.scenario.load import Loaded, load_any
    from landing_cli.scenario.schema import Scenario

    loaded = load_any(scenario, overrides or ())
    console.Console(quiet).say(f"read {loaded.source}")
    if isinstance(loaded.scenario, Scenario):
        facts = _landing_facts(Loaded(loaded.scenario, loaded.source, loaded.beside, loaded.places))
    else:
        facts = _tour_facts(Loaded(loaded.scenario, loaded.source, loaded.beside, loaded.places))
    if as_json:
        console.print_json(facts)
    else:
        console.print_table(["quantity", "value"], [[key, _plain(value)] for key, value in facts.items()])


@app.command()
def schema() -> None:
    """Print the JSON Schema of scenario files, for editors."""
    from landing_cli.scenario.schema import json_schema

    console.print_json(json_schema())


def _landing_facts(loaded: LoadedScenario) -> dict[str, object]:
    from landing_cli.scenario.build import build

    built = build(loaded)
    return {
        "scenario": loaded.scenario.name,
        "facets": len(built.asteroid.mesh.faces),
        "gm_m3_s2": built.asteroid.gm_m3_s2,
        "rotation_rate_rad_s": built.asteroid.rotation_rate_rad_s,
        **_reach_facts(loaded.scenario, built),
        **_plan_facts(loaded, built),
        **_observe_facts(loaded, built),
        **_disperse_facts(loaded, built),
        "shape_sha256": built.shape_sha256,
    }


def _tour_facts(loaded: LoadedTour) -> dict[str, object]:
    from landing_cli.cli.tour_tables import case_facts
    from landing_cli.tour.cases import tour_case

    return case_facts(tour_case(loaded))


def _reach_facts(scenario: Scenario, built: Built) -> dict[str, object]:
    if scenario.reach is None or built.ellipsoid_m is None:
        return {}
    return {
        "ellipsoid_m": [round(float(axis), 3) for axis in built.ellipsoid_m],
        "cases": [name for name, _, _ in scenario.reach.cases()],
    }


def _disperse_facts(loaded: LoadedScenario, built: Built) -> dict[str, object]:
    """Check the dispersion section against body and spacecraft, and tell one sigma of each quantity."""
    if loaded.scenario.disperse is None or loaded.scenario.reach is None:
        return {}
    from landing_cli.studies.disperse.records import drivers_of
    from landing_cli.studies.disperse.request import request_of

    request = request_of(loaded, built)
    spread = request.drawing.spread
    sigmas = zip(drivers_of(spread.axes), spread.sigmas.tolist(), strict=True)
    return {
        "dispersed_cases": [case.name for _, case in request.cases],
        "dispersed_sigmas": [f"{driver.name.lower()} {sigma:.5g}" for driver, sigma in sigmas],
    }


def _plan_facts(loaded: LoadedScenario, built: Built) -> dict[str, object]:
    """Check the planning section against the mesh, and tell what it comes to."""
    if loaded.scenario.plan is None:
        return {}
    from landing_cli.plan.cases import plan_cases

    cases = plan_cases(loaded, built.asteroid, built.spacecraft)
    return {
        "site_m": [round(float(x), 3) for x in cases[0].site.position_m],
        "site_facet": cases[0].site.facet,
        "clearance_m": round(cases[0].clearance_m, 3),
        "plans": [case.name for case in cases],
    }


def _observe_facts(loaded: LoadedScenario, built: Built) -> dict[str, object]:
    """Check the observation section against the mesh and the landmarks, and tell what it comes to."""
    if loaded.scenario.observe is None:
        return {}
    from landing_cli.observe.cases import observe_case
    from landing_cli.observe.landmark_source import with_landmarks_hash

    case = observe_case(with_landmarks_hash(loaded), built.asteroid, built.spacecraft)
    return {
        "observe_site_m": [round(float(x), 3) for x in case.frame.origin_m],
        "observe_site_facet": case.frame.facet,
        "observe_start_m": [round(float(x), 3) for x in case.position_m],
        "landmarks": len(case.landmarks.position_m),
        "illumination": case.sun_direction is not None and case.sensor.kind == "camera",
    }


def _plain(value: object) -> object:
    return ", ".join(map(str, value)) if isinstance(value, list) else value


def _write_new(path: Path, text: str, force: bool) -> None:
    """Write a file whole or not at all, and never over another one unasked."""
    from landing_cli.sources.whole_file import write_whole

    if path.exists() and not force:
        raise OutputRefused("is there already", where=str(path), fix="take another name, or --force")
    try:
        write_whole(path, text.encode())
    except OSError as error:
        raise OutputRefused(f"cannot be written: {error.strerror}", where=str(path)) from None
