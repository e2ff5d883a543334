"""The clusters of landmarks as a group of the result file."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np

from landing_cli.observe.observed import Clustering
from landing_cli.observe.records import Side
from landing_cli.observe.stored_paths import LARGEST
from landing_cli.results.body_checks import bounded
from landing_cli.results.tree import Dataset, Group

_CHOSEN_BY = ("elbow", "given")
_SIDE_CHOSEN_BY = ("more_centers", "given", "more_landmarks")


def clustering_to_group(clustering: Clustering) -> Group:
    """Lay clusters out for the store.

    Parameters
    ----------
    clustering : Clustering
        Of the run's landmarks.

    Returns
    -------
    Group
    """
    members = {
        "label": Dataset(clustering.label, "1", "cluster of each landmark", ("landmark",)),
        "center_m": Dataset(clustering.center_m, "m", "centres mu_j, site frame", ("cluster", "xy")),
        "side": Dataset(clustering.side, "1", "side of the unsteered path: 1 left, -1 right", ("cluster",)),
        "sse_m2": Dataset(clustering.sse_m2, "m2", "I_SSE of 1, 2, ... clusters", ("count",)),
        "control_points_m": Dataset(
            clustering.control_points_m, "m", "inner control points, site frame", ("point", "xy")
        ),
    }
    words = {
        "chosen_by": clustering.chosen_by,
        "steered_to": clustering.steered_to,
        "side_chosen_by": clustering.side_chosen_by,
    }
    return Group(members, words)


def clustering_from_group(group: Group, landmarks: int) -> Clustering:
    """Rebuild clusters.

    Parameters
    ----------
    group : Group
        From `clustering_to_group`.
    landmarks : int
        How many the run has.

    Returns
    -------
    Clustering

    Raises
    ------
    KeyError, ValueError
        If a part is missing or wrong.
    """
    arrays: dict[str, Any] = {
        name: group.dataset(name).data for name in ("label", "center_m", "side", "sse_m2", "control_points_m")
    }
    words: dict[str, Any] = {}
    allowed = {
        "chosen_by": _CHOSEN_BY,
        "steered_to": get_args(Side),
        "side_chosen_by": _SIDE_CHOSEN_BY,
    }
    for name, choices in allowed.items():
        words[name] = group.attributes[name]
        if words[name] not in choices:
            raise ValueError(f"no {name} {words[name]}")
    count = len(arrays["center_m"])
    for name in ("label", "side"):
        if arrays[name].dtype.kind not in "iu":
            raise ValueError(f"{name} is {arrays[name].dtype}")
        arrays[name] = arrays[name].astype(np.int64)
    for name in ("center_m", "control_points_m"):
        if arrays[name].shape[1:] != (2,):
            raise ValueError(f"{name} is {arrays[name].shape}")
    for name in ("center_m", "sse_m2", "control_points_m"):
        bounded(name, arrays[name], LARGEST)
    if arrays["label"].shape != (landmarks,) or arrays["side"].shape != (count,):
        raise ValueError("the clusters are not those of the landmarks")
    if not 0 <= arrays["label"].min() <= arrays["label"].max() < count:
        raise ValueError("a landmark belongs to no cluster")
    return Clustering(**arrays, **words)
