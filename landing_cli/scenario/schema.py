"""The scenario: every key, its unit, its range and its default."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Discriminator, Field, Tag, TypeAdapter, ValidationError

from landing_cli.scenario.messages import KeyPath, Problem, refusal
from landing_cli.scenario.schema_base import (
    Auto,
    FinalStage,
    Number3,
    Positive3,
    Seconds,
    Section,
    Times,
    exactly_one,
    word_or_value,
    wrong,
)
from landing_cli.scenario.schema_body import Body
from landing_cli.scenario.schema_disperse import DisperseSection
from landing_cli.scenario.schema_isochrone import IsochroneSection
from landing_cli.scenario.schema_observe import ObserveSection
from landing_cli.scenario.schema_plan import PlanSection
from landing_cli.scenario.schema_tour import TourScenario
from landing_cli.scenario.translate import problems_of

S = TypeVar("S", bound=Section)


# Of the time of flight, where the final stage's duration is free.
FREE_STAGE_SHARES = (0.05, 0.75)


class SpacecraftSection(Section):
    """The lander: a point mass with one throttleable thruster."""

    mass_kg: float = Field(gt=0, le=1e7, description="initial mass, kg")
    thrust_max_n: float = Field(gt=0, le=1e7, description="largest thrust, N")
    isp_s: float = Field(ge=1, le=1e6, description="specific impulse, s")
    propellant_kg: float | None = Field(None, gt=0, le=1e7, description="propellant on board, kg; a bound")

    def model_post_init(self, context: Any, /) -> None:
        """Refuse a spacecraft made of propellant alone."""
        if self.propellant_kg is not None and self.propellant_kg >= self.mass_kg:
            raise wrong(
                "propellant_kg",
                f"{self.propellant_kg:g} is not below mass_kg = {self.mass_kg:g}",
                "mass_kg includes the propellant",
            )


class InitialState(Section):
    """Where a descent begins, in the rotating body frame."""

    name: str = Field(
        pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,63}$",
        description="name in tables and files: a letter, then letters, digits, _ or -",
    )
    position_km: Number3 | None = Field(None, description="position in the body frame, km")
    position_m: Number3 | None = Field(
        None, description="position in the body frame, m, instead of position_km"
    )
    velocity_m_s: Number3 = Field(
        (0.0, 0.0, 0.0), description="velocity relative to the rotating body frame, m/s"
    )
    tof_s: Times | None = Field(None, description="times of flight of this state, s, instead of reach.tof_s")

    def model_post_init(self, context: Any, /) -> None:
        """Refuse two positions, none, one beyond any mission, or a speed of light."""
        exactly_one(self, "position_km", "position_m")
        key = "position_m" if self.position_km is None else "position_km"
        if max(map(abs, self.start_m)) > 1e9:
            raise wrong(key, "is more than a million km from the body", "check the unit")
        if max(map(abs, self.velocity_m_s)) > 1e4:
            raise wrong("velocity_m_s", "is faster than 10 km/s", "check the unit: m/s")

    @property
    def start_m(self) -> Number3:
        """Position in the body frame, m."""
        if self.position_m is not None:
            return self.position_m
        assert self.position_km is not None
        x, y, z = self.position_km
        return 1000 * x, 1000 * y, 1000 * z


class SectionMethod(Section):
    """The paper's plane section and expansion."""

    h_m: Auto | Annotated[Annotated[float, Field(gt=0, le=1e6)], Tag("value")] = Field(
        default="auto",
        discriminator=Discriminator(word_or_value),
        description="band width h, m, or auto: the mean edge",
    )
    azimuth_deg: float = Field(
        default=0.0,
        ge=-360,
        le=360,
        description="azimuth of the section plane about the line to the initial position, deg",
    )


class Reach(Section):
    """Where the spacecraft can land: initial states, times of flight and constraints."""

    initial_states: tuple[InitialState, ...] = Field(
        min_length=1, max_length=1000, description="list of states from which the descent begins"
    )
    tof_s: Times | None = Field(None, description="time of flight, s: a number, or a list of them")
    final_stage_s: FinalStage = Field(
        description="part of the time of flight that the final landing stage takes, s: a number; "
        "or chosen for each facet: [shortest, longest] | free (5 to 75 % of the time of flight)"
    )
    final_stage_compared_s: Seconds | None = Field(
        None, description="with a free final stage: the duration whose domain it is compared with, s"
    )
    ellipsoid_m: Auto | Annotated[Positive3, Tag("value")] = Field(
        "auto",
        discriminator=Discriminator(word_or_value),
        description="keep-out ellipsoid, semi-axes in m: [a, b, c], or auto: the least that holds the body",
    )
    glide_slope_half_angle_deg: float = Field(
        60.0,
        gt=0,
        lt=90,
        description="half-angle of the final stage's cone about the outward facet normal, deg",
    )
    handover: Literal["outside", "on_ellipsoid"] = Field(
        "outside",
        description="where the descent stage may end: outside | on_ellipsoid (the paper's transition point)",
    )
    descent: Literal["free", "extremal"] = Field(
        "free", description="family of descent trajectories: free (conic) | extremal (the paper's)"
    )
    final_stage_thrust: Literal["compensated", "paper"] = Field(
        "compensated",
        description="the final stage's thrust bound holds for: compensated (the real thrust) | paper (eq 14)",
    )
    terrain: Literal["report", "require"] = Field(
        "report",
        description="whether a path that cuts the mesh is a landing: report | require (another is sought)",
    )
    margin: bool = Field(
        False, description="whether every facet is asked for its least thrust level, and its boundary traced"
    )
    method: Literal["traverse", "section", "trace"] = Field(
        "traverse",
        description="how the domain is found: traverse (every facet) | section (the paper's) | "
        "trace (its boundary, by the margin)",
    )
    section: SectionMethod = Field(
        SectionMethod(),
        description="parameters of the section method",
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse states without a name of their own or without a time, and choices that contradict."""
        self._check_names()
        self._check_final_stage()
        if self.method == "trace":
            self._check_trace()
        if self.tof_s is not None:
            self._check_times(self.tof_s, "tof_s")
        for index, state in enumerate(self.initial_states):
            if state.tof_s is not None:
                self._check_times(state.tof_s, f"initial_states.{index}.tof_s")
            elif self.tof_s is None:
                raise wrong(
                    "tof_s", "is missing", f"give reach.tof_s, or tof_s in initial state {state.name}"
                )

    def final_stages_s(self, tof_s: float) -> tuple[float, float]:
        """Return the shortest and the longest duration of the final stage in a flight, s."""
        if isinstance(self.final_stage_s, tuple):
            return self.final_stage_s
        if isinstance(self.final_stage_s, float):
            return self.final_stage_s, self.final_stage_s
        shortest, longest = FREE_STAGE_SHARES
        return shortest * tof_s, longest * tof_s

    def times_of(self, state: InitialState) -> tuple[float, ...]:
        """Return the times of flight that are flown from one initial state, s."""
        times = self.tof_s if state.tof_s is None else state.tof_s
        assert times is not None
        return times

    def cases(self) -> list[tuple[str, InitialState, float]]:
        """Case name (``north_pole_700s``), initial state and time of flight, s, of every case."""
        return [
            (f"{state.name}_{tof_s:.12g}s", state, tof_s)
            for state in self.initial_states
            for tof_s in self.times_of(state)
        ]

    def _check_trace(self) -> None:
        """A trace follows the least thrust level: it must be what decides."""
        for key, value, other in (("descent", self.descent, "free"), ("terrain", self.terrain, "report")):
            if value != other:
                raise wrong(
                    "method",
                    f"trace follows the least thrust level, which does not decide with {key}: {value}",
                    f"take {key}: {other}, or method: traverse",
                )
        if not isinstance(self.final_stage_s, float):
            raise wrong(
                "method",
                "trace follows the least thrust level of one duration, and final_stage_s is free",
                "give final_stage_s a number, or method: traverse",
            )

    def _check_names(self) -> None:
        first: dict[str, int] = {}
        for index, state in enumerate(self.initial_states):
            if state.name in first:
                raise wrong(
                    f"initial_states.{index}.name",
                    f"{state.name} is the name of initial state {first[state.name]} too",
                    "give each its own",
                )
            first[state.name] = index

    def _check_final_stage(self) -> None:
        free, compared = not isinstance(self.final_stage_s, float), self.final_stage_compared_s
        if isinstance(self.final_stage_s, tuple) and self.final_stage_s[0] >= self.final_stage_s[1]:
            shortest, longest = self.final_stage_s
            raise wrong(
                "final_stage_s", f"[{shortest:g}, {longest:g}] does not ascend", "[shortest, longest]"
            )
        if free and self.descent == "extremal":
            raise wrong(
                "final_stage_s", "is free, but descent is extremal", "give a number, or descent: free"
            )
        if compared is not None and not free:
            raise wrong(
                "final_stage_compared_s",
                "is given, but final_stage_s is a number",
                "leave it out, or make final_stage_s free",
            )

    def _check_times(self, times: tuple[float, ...], key: str) -> None:
        for index, tof_s in enumerate(times):
            longest = {"final_stage_s": self.final_stages_s(tof_s)[1]}
            longest["final_stage_compared_s"] = self.final_stage_compared_s or 0.0
            for name, duration_s in longest.items():
                if tof_s <= duration_s:
                    raise wrong(
                        name,
                        f"{duration_s:g} is not shorter than the time of flight of {tof_s:g} s",
                        f"the final stage is part of the flight: shorten it, or lengthen {key}",
                    )
            if any(f"{tof_s:.12g}" == f"{earlier:.12g}" for earlier in times[:index]):
                raise wrong(f"{key}.{index}", f"{tof_s:g} is in the list twice", "remove one")


class Scenario(Section):
    """One body, one spacecraft, and what is asked of them."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$",
        description="name of the scenario and of its results: letters, digits, _ . -",
    )
    body: Body = Field(description="the asteroid")
    spacecraft: SpacecraftSection = Field(description="the lander")
    reach: Reach | None = Field(None, description="the reachable domain: `reach run`")
    plan: PlanSection | None = Field(None, description="the flight to one site: `plan bezier` and others")
    observe: ObserveSection | None = Field(
        None, description="the landing that sees its landmarks: `plan observe`"
    )
    isochrone: IsochroneSection | None = Field(
        None, description="the times of flight at which each facet is reachable: `reach isochrone`"
    )
    disperse: DisperseSection | None = Field(
        None, description="what is not known exactly, and how well it is known: `reach disperse`"
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse a scenario that asks nothing, and a fit to a field that needs none."""
        if self.reach is None and self.plan is None and self.observe is None:
            raise wrong(
                "reach", "is missing, and so are plan and observe", "a scenario asks for at least one"
            )
        final_stage_s = None if self.reach is None else self.reach.final_stage_s
        if self.isochrone is not None and isinstance(final_stage_s, float):
            self.isochrone.check_against(final_stage_s)


AnyScenario = Scenario | TourScenario


def from_tree(tree: Any, places: Mapping[KeyPath, str] | None = None, source: str = "scenario") -> Scenario:
    """Check plain values and make the scenario of a landing of them.

    Parameters
    ----------
    tree : dict of plain values
        As they stand in a scenario file.
    places : mapping, optional
        "file:line" of each key path, for messages.
    source : str
        What to call the scenario in messages.

    Returns
    -------
    Scenario

    Raises
    ------
    InputRefused
        Something is wrong; each problem is named with its place, dotted key, value and fix.
    """
    if is_tour(tree):
        problem = Problem(("tour",), "the scenario is of a flyby tour, without a body", "`tour` takes it")
        raise refusal([problem], places or {}, source)
    return _checked(tree, Scenario, places or {}, source)


def tour_from_tree(
    tree: Any, places: Mapping[KeyPath, str] | None = None, source: str = "scenario"
) -> TourScenario:
    """Check plain values and make the scenario of a flyby tour of them.

    Parameters
    ----------
    tree : dict of plain values
        As they stand in a scenario file.
    places : mapping, optional
        "file:line" of each key path, for messages.
    source : str
        What to call the scenario in messages.

    Returns
    -------
    TourScenario

    Raises
    ------
    InputRefused
        Something is wrong; each problem is named with its place, dotted key, value and fix.
    """
    if isinstance(tree, dict) and not is_tour(tree):
        problem = Problem(
            ("tour",), "the scenario has no such section", "`tour` needs departure and limits there"
        )
        raise refusal([problem], {}, source)
    return _checked(tree, TourScenario, places or {}, source)


def is_tour(tree: Any) -> bool:
    """Tell whether plain values are those of a flyby tour: they have a section ``tour``."""
    return isinstance(tree, dict) and "tour" in tree


def to_tree(scenario: AnyScenario) -> dict[str, Any]:
    """Return every key with its value or default, as plain values that are read back."""
    return scenario.model_dump(mode="json")


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of scenario files, for editors: of a landing or of a tour."""
    adapter: TypeAdapter[AnyScenario] = TypeAdapter(AnyScenario)
    return adapter.json_schema()


def _checked(tree: Any, model: type[S], places: Mapping[KeyPath, str], source: str) -> S:
    try:
        # JSON's own strictness: a list is a tuple, but text is no number
        return model.model_validate_json(json.dumps(tree))
    except ValidationError as error:
        problems = problems_of(error, model)
    raise refusal(problems, places, source)
