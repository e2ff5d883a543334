"""The official shape models that ``landing shapes fetch`` knows by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

_ARCHIVE = "https://sbnarchive.psi.edu/pds3"


@dataclass(frozen=True)
class OfficialShape:
    """A file of the Small Bodies Node of NASA's Planetary Data System.

    Attributes
    ----------
    title : str
        Body, model and data set.
    url : str
    length_unit : {"km", "m"}
        Of its coordinates.
    published_hash : str, optional
        As ``algorithm:hex``.
    """

    title: str
    url: str
    length_unit: Literal["km", "m"] = "km"
    published_hash: str | None = None


OFFICIAL_SHAPES = {
    "bennu": OfficialShape(
        "101955 Bennu, radar model (Nolan et al. 2013), EAR-A-I0037-5-BENNUSHAPE-V1.0",
        f"{_ARCHIVE}/non_mission/EAR_A_I0037_5_BENNUSHAPE_V1_0/data/101955bennu.tab",
        published_hash="md5:c814437e2f5a9f870841cec445cc55fd",
    ),
    "bacchus": OfficialShape(
        "2063 Bacchus, radar model (Benner et al. 1999), EAR-A-5-DDR-RADARSHAPE-MODELS-V2.0",
        f"{_ARCHIVE}/non_mission/EAR_A_5_DDR_RADARSHAPE_MODELS_V2_0/data/2063bacchus.tab",
    ),
    "eros": OfficialShape(
        "433 Eros, NEAR plate model of 7790 plates (Thomas et al. 2002), NEAR-A-5-COLLECTED-MODELS-V1.0",
        f"{_ARCHIVE}/near/NEAR_A_5_COLLECTED_MODELS_V1_0/data/msi/eros007790.tab",
    ),
}
