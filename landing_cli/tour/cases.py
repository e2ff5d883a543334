"""What a tour scenario asks, in SI: departure, targets, limits and the choices of the search."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import AU_M, DAY_S
from landing_cli.scenario.load import LoadedTour
from landing_cli.scenario.messages import Problem, refusal
from landing_cli.scenario.schema_tour import DepartureSection, LimitsSection, TargetsSection, TourSection
from landing_cli.sources.catalogue_files import read_catalogue
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.sources.catalogue_search import find_catalogue
from landing_cli.tour.departure import departure_from_polar, departure_from_state
from landing_cli.tour.ephemeris import Ephemeris, flight_ephemeris
from landing_cli.tour.records import BeamOptions, Departure, LayeredOptions, SearchLimits, TargetLimits
from landing_cli.tour.run_records import RunKind, TourFacts
from landing_cli.tour.targets import embedded_catalogue, refuse_far_epochs, select
from landing_cli.tour.time_scales import utc_to_t_s

EMBEDDED = "liu2023"


@dataclass(frozen=True, eq=False)
class TourCase:
    """One departure, the asteroids around it, and what a chain of flybys must keep to.

    Attributes
    ----------
    name : str
        Of the scenario.
    catalogue : Catalogue
        As read.
    targets : Catalogue
        Those of its asteroids that are searched.
    departure : Departure
    limits : SearchLimits
    options : BeamOptions or LayeredOptions
        Of the method that the scenario names.
    albedo : float
    kernel : str
        Name of the ephemeris kernel.
    ephemeris : Ephemeris
        Over the flight.
    """

    name: str
    catalogue: Catalogue
    targets: Catalogue
    departure: Departure
    limits: SearchLimits
    options: BeamOptions | LayeredOptions
    albedo: float
    kernel: str
    ephemeris: Ephemeris

    def facts(self, kind: RunKind, targets: Catalogue) -> TourFacts:
        """Tell what a run of this case stores beside its chains.

        Parameters
        ----------
        kind : {"search", "compare"}
            Of the run.
        targets : Catalogue
            The asteroids that its chains pass.

        Returns
        -------
        TourFacts
        """
        return TourFacts(
            name=self.name,
            kind=kind,
            method="beam" if isinstance(self.options, BeamOptions) else "layered",
            departure=self.departure,
            limits=self.limits,
            albedo=self.albedo,
            ephemeris=self.kernel,
            targets=targets,
            catalogue_rows=len(self.catalogue) + len(self.catalogue.bad_rows),
            catalogue_bad_rows=len(self.catalogue.bad_rows),
            searched_targets=len(self.targets),
        )


def tour_case(loaded: LoadedTour) -> TourCase:
    """Read the catalogue and the ephemeris that a scenario names, and put its numbers into SI.

    Parameters
    ----------
    loaded : LoadedTour
        The checked scenario.

    Returns
    -------
    TourCase

    Raises
    ------
    InputRefused
        The catalogue or the ephemeris is missing or unfit, or no asteroid is a target.
    """
    tour = loaded.scenario.tour
    limits = search_limits(tour.limits)
    start_t_s = utc_to_t_s(tour.departure.epoch_utc, "tour.departure.epoch_utc")
    catalogue = catalogue_of(loaded)
    targets = select(catalogue, target_limits(tour.targets))
    refuse_far_epochs(targets, start_t_s, limits.end_t_s)
    epochs = targets.elements.epoch_t_s
    first_t_s, last_t_s = min(start_t_s, float(epochs.min())), max(limits.end_t_s, float(epochs.max()))
    try:
        ephemeris = flight_ephemeris(tour.ephemeris, first_t_s, last_t_s)
    except InputRefused as error:
        raise InputRefused(error.what, where=f"tour.ephemeris: {error.where}", fix=error.fix) from error
    return TourCase(
        loaded.scenario.name,
        catalogue,
        targets,
        _departure(tour.departure, start_t_s, ephemeris),
        limits,
        search_options(tour),
        tour.targets.albedo,
        tour.ephemeris,
        ephemeris,
    )


def catalogue_of(loaded: LoadedTour) -> Catalogue:
    """Read the catalogue that a scenario names.

    Parameters
    ----------
    loaded : LoadedTour
        The checked scenario.

    Returns
    -------
    Catalogue

    Raises
    ------
    InputRefused
        It is missing or none.
    """
    name = loaded.scenario.tour.catalogue
    if name == EMBEDDED:
        return embedded_catalogue()
    try:
        path = find_catalogue(name, loaded.beside)
    except InputRefused as error:
        problem = Problem(("tour", "catalogue"), f"{error.where}: {error.what}", error.fix)
        raise refusal([problem], loaded.places, loaded.source) from error
    return read_catalogue(path)


def target_limits(section: TargetsSection) -> TargetLimits:
    """Put a section's numbers into SI.

    Parameters
    ----------
    section : TargetsSection
        Of the scenario.

    Returns
    -------
    TargetLimits
    """
    faintest = section.absolute_magnitude_max
    return TargetLimits(
        perihelion_max_m=section.perihelion_max_au * AU_M,
        absolute_magnitude_max=math.inf if faintest is None else faintest,
        condition_code_max=section.condition_code_max,
        numbered_only=section.numbered_only,
        excluded=section.exclude,
        albedo=section.albedo,
    )


def search_limits(section: LimitsSection) -> SearchLimits:
    """Put a section's numbers into SI.

    Parameters
    ----------
    section : LimitsSection
        Of the scenario.

    Returns
    -------
    SearchLimits
    """
    farthest = section.geocentric_distance_max_km
    return SearchLimits(
        delta_v_m_s=section.delta_v_m_s,
        end_t_s=utc_to_t_s(section.end_utc, "tour.limits.end_utc"),
        geocentric_distance_m=math.inf if farthest is None else farthest * 1e3,
        asteroids_max=section.asteroids_max,
        revolutions_max=section.revolutions_max,
        first_burn_wait_s=section.first_burn_wait_d * DAY_S,
    )


def search_options(section: TourSection) -> BeamOptions | LayeredOptions:
    """Return the choices of the method that a scenario names.

    Parameters
    ----------
    section : TourSection
        Of the scenario.

    Returns
    -------
    BeamOptions or LayeredOptions
    """
    if section.method == "beam":
        beam = section.beam
        return BeamOptions(
            beam=beam.beam,
            time_step_s=beam.time_step_d * DAY_S,
            waits_s=tuple(days * DAY_S for days in beam.waits_d),
            branches=beam.branches,
            kept_chains=beam.kept_chains,
        )
    layered = section.layered
    return LayeredOptions(
        distance_m=layered.coast_distance_max_km * 1e3,
        k1=layered.k1,
        k2=layered.k2,
        k3=layered.k3,
        time_step_s=layered.time_step_d * DAY_S,
        kept_chains=layered.kept_chains,
    )


def _departure(section: DepartureSection, t_s: float, ephemeris: Ephemeris) -> Departure:
    if section.position_km is not None and section.velocity_m_s is not None:
        position_m = 1e3 * np.array(section.position_km)
        return departure_from_state(t_s, position_m, np.array(section.velocity_m_s), ephemeris)
    assert section.distance_km is not None  # the schema holds the section to one of the two
    assert section.sun_angle_deg is not None
    assert section.radial_speed_m_s is not None
    return departure_from_polar(
        t_s,
        section.distance_km * 1e3,
        math.radians(section.sun_angle_deg),
        section.radial_speed_m_s,
        ephemeris,
    )
