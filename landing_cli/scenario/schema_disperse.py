"""The dispersion section: what is not known exactly at the start, and how well it is known."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from landing_cli.scenario.schema_base import Section, as_tuple, wrong

# No draw goes farther than 8.3 sigma, so a tenth keeps every mass, thrust and GM above a sixth of itself.
LARGEST_RELATIVE = 0.1
# Entries of a covariance come out of other programs with some nine digits.
_ROUNDING = 1e-8

Sigma = Annotated[float, Field(ge=0, le=1e9)]
Relative = Annotated[float, Field(ge=0, le=LARGEST_RELATIVE)]
Sigmas3 = tuple[Sigma, Sigma, Sigma]
Entry = Annotated[float, Field(ge=-1e18, le=1e18)]
Row6 = tuple[Entry, Entry, Entry, Entry, Entry, Entry]
Matrix6 = tuple[Row6, Row6, Row6, Row6, Row6, Row6]
CaseName = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*_[0-9.e+-]+s$", max_length=100)]
CaseNames = Annotated[
    tuple[CaseName, ...],
    Field(min_length=1, max_length=1000),
    BeforeValidator(as_tuple, json_schema_input_type=list[CaseName]),
]


class DisperseSection(Section):
    """How the start is dispersed: `reach disperse`."""

    samples: int = Field(1000, ge=1, le=1_000_000, description="dispersed starts to draw")
    seed: int = Field(1, ge=0, le=2**53, description="seed of the draws; sample k depends on it and k alone")
    confidence: float = Field(
        0.95, ge=0.5, le=0.9999, description="level of the probability's confidence interval"
    )
    cases: CaseNames | None = Field(
        None, description="names of the cases to disperse, as north_pole_700s; all unless given"
    )
    axes: Literal["body", "radial_along_cross"] = Field(
        "body",
        description="axes of the state's dispersion: body | radial_along_cross (along: the inertial velocity "
        "across the radius)",
    )
    position_sigma_m: Sigmas3 | None = Field(None, description="1 sigma of the position along each axis, m")
    velocity_sigma_m_s: Sigmas3 | None = Field(
        None, description="1 sigma of the velocity relative to the rotating frame along each axis, m/s"
    )
    covariance: Matrix6 | None = Field(
        None,
        description="of position and velocity, 6 x 6, m2, m2/s and m2/s2, instead of the two sigmas",
    )
    mass_sigma_kg: Sigma | None = Field(None, description="1 sigma of the initial mass, kg")
    mass_sigma_relative: Relative | None = Field(
        None, description="1 sigma of the initial mass over the mass, instead of mass_sigma_kg"
    )
    thrust_sigma_n: Sigma | None = Field(None, description="1 sigma of the largest thrust, N")
    thrust_sigma_relative: Relative | None = Field(
        None, description="1 sigma of the largest thrust over the thrust, instead of thrust_sigma_n"
    )
    gm_sigma_m3_s2: Sigma | None = Field(None, description="1 sigma of GM, m3/s2")
    gm_sigma_relative: Relative | None = Field(
        None, description="1 sigma of GM over GM, instead of gm_sigma_m3_s2"
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse a quantity that is dispersed twice, and a matrix that is no covariance."""
        for first, second in (
            ("position_sigma_m", "covariance"),
            ("velocity_sigma_m_s", "covariance"),
            ("mass_sigma_kg", "mass_sigma_relative"),
            ("thrust_sigma_n", "thrust_sigma_relative"),
            ("gm_sigma_m3_s2", "gm_sigma_relative"),
        ):
            if getattr(self, first) is not None and getattr(self, second) is not None:
                raise wrong(second, f"stands beside {first}", "give one of them")
        self.state_factor()

    @property
    def disperses(self) -> bool:
        """Whether it says of anything how well it is known."""
        names = [name for name in type(self).model_fields if "sigma" in name or name == "covariance"]
        return any(getattr(self, name) is not None for name in names)

    def state_factor(self) -> list[list[float]]:
        """Lower triangular factor L of the state's covariance L L', (6, 6); m and m/s.

        Sums run in a fixed order, so that the factor is the same on every machine.
        """
        if self.covariance is not None:
            return _semidefinite_factor(self.covariance)
        none = (0.0, 0.0, 0.0)
        sigmas = (*(self.position_sigma_m or none), *(self.velocity_sigma_m_s or none))
        return [[sigmas[i] if i == j else 0.0 for j in range(6)] for i in range(6)]


def _semidefinite_factor(matrix: Matrix6) -> list[list[float]]:
    """Cholesky's factor, with zero columns where a component follows from those before it."""
    sigmas = [math.sqrt(max(matrix[i][i], 0.0)) for i in range(6)]
    factor = [[0.0] * 6 for _ in range(6)]
    for i in range(6):
        if matrix[i][i] < 0.0:
            raise wrong(f"covariance.{i}.{i}", f"{matrix[i][i]:g} is a negative variance", "check the order")
        for j in range(i + 1):
            scale = sigmas[i] * sigmas[j]
            if abs(matrix[i][j] - matrix[j][i]) > _ROUNDING * scale:
                told = f"{matrix[i][j]:g} is not {matrix[j][i]:g}, as it stands on the other side"
                raise wrong(f"covariance.{i}.{j}", told, "a covariance is symmetric")
            rest = matrix[i][j] - sum(factor[i][k] * factor[j][k] for k in range(j))
            if i == j:
                if rest < -_ROUNDING * scale:
                    told = "has a negative variance along some direction"
                    raise wrong("covariance", told, "a covariance is positive semidefinite")
                factor[i][i] = math.sqrt(rest) if rest > _ROUNDING * scale else 0.0
            elif factor[j][j] > 0.0:
                factor[i][j] = rest / factor[j][j]
            elif abs(rest) > math.sqrt(_ROUNDING) * scale:
                told = f"{matrix[i][j]:g} goes with a direction that has no variance"
                raise wrong(f"covariance.{i}.{j}", told, "a covariance is positive semidefinite")
    return factor
