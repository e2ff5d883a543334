"""What a verification found: every mission flies its stored paths again and reports in this way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Check:
    """One respect in which a flight was checked."""

    value: float
    limit: float

    @property
    def failing(self) -> bool:
        """Whether it is beyond its limit; what is no number is."""
        return not self.value <= self.limit


@dataclass(frozen=True)
class Report:
    """What the re-flight of a stored path found.

    Attributes
    ----------
    case : str
        Name of the plan, observation or chain.
    status : str
        As stored.
    flown : bool
        Whether it claims to be flown: a chain that broke, say, does not.
    worst : mapping of str to Check
        By what was checked, causes before effects.
    fault : str
        What cannot be true in the record; empty where nothing is.
    """

    case: str
    status: str
    flown: bool
    worst: Mapping[str, Check]
    fault: str

    @property
    def verified(self) -> bool:
        """Whether everything is as the result says."""
        return not self.fault and not any(check.failing for check in self.worst.values())

    @property
    def badness(self) -> float:
        """How far the worst check is beyond its limit, as a multiple of it; infinite for a fault."""
        if self.fault:
            return math.inf
        values = [c.value / c.limit if c.value == c.value else math.inf for c in self.worst.values()]
        return max(values, default=0.0)

    @property
    def reason(self) -> str:
        """What is wrong, causes before effects; empty where nothing is."""
        if self.fault:
            return f"{self.case}: {self.fault}"
        for name, check in self.worst.items():
            if check.failing:
                return f"{self.case}: {name} {check.value:.3g}, at most {check.limit:g} is allowed"
        return ""


@dataclass(frozen=True)
class FieldReport(Report):
    """Of a landing: what another gravity field would have done to it.

    Attributes
    ----------
    polyhedron_miss_m : float or None
        Miss of the same control under the polyhedron; None where it was not flown.
    """

    polyhedron_miss_m: float | None
