"""The isochrone section: the range of times of flight, and how finely it is looked at."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from landing_cli.scenario.schema_base import Auto, Seconds, Section, word_or_value, wrong

MOST_STEPS, MOST_HALVINGS = 2000, 14


class IsochroneSection(Section):
    """When each facet is reachable: `reach isochrone`."""

    tof_min_s: Auto | Annotated[Seconds, Tag("value")] = Field(
        default="auto",
        discriminator=Discriminator(word_or_value),
        description="shortest time of flight, s, or auto: of a crossing at full thrust to the nearest facet",
    )
    tof_max_s: Auto | Annotated[Seconds, Tag("value")] = Field(
        default="auto",
        discriminator=Discriminator(word_or_value),
        description="longest time of flight, s, or auto: the longest of reach",
    )
    step_s: Seconds = Field(
        default=25.0,
        description="step between times at which every facet is asked, s; a shorter gap may be missed",
    )
    tolerance_s: Seconds = Field(
        default=0.5, description="how closely the ends of each facet's intervals are found, s"
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse a range that is none, and steps without number."""
        if self.tolerance_s > self.step_s:
            told = f"{self.tolerance_s:g} is longer than step_s = {self.step_s:g}"
            raise wrong("tolerance_s", told, "it parts the steps: make it shorter")
        if self.step_s > self.tolerance_s * 2**MOST_HALVINGS:
            told = (
                f"{self.tolerance_s:g} parts a step of {self.step_s:g} s more than {2**MOST_HALVINGS} times"
            )
            raise wrong("tolerance_s", told, "lengthen it, or shorten step_s")
        if self.tof_min_s != "auto" and self.tof_max_s != "auto":
            if self.tof_max_s <= self.tof_min_s:
                told = f"{self.tof_max_s:g} is not longer than tof_min_s = {self.tof_min_s:g}"
                raise wrong("tof_max_s", told, "lengthen it")
            if self.tof_max_s - self.tof_min_s > MOST_STEPS * self.step_s:
                told = f"{self.step_s:g} makes more than {MOST_STEPS} steps of the range"
                raise wrong("step_s", told, "lengthen it")

    def check_against(self, final_stage_s: float) -> None:
        """Refuse times of flight in which the final stage alone does not fit."""
        for key in ("tof_min_s", "tof_max_s"):
            value = getattr(self, key)
            if value != "auto" and value <= final_stage_s:
                told = f"{value:g} is not longer than reach.final_stage_s = {final_stage_s:g}"
                raise wrong(f"isochrone.{key}", told, "the final stage is part of the flight: lengthen it")
