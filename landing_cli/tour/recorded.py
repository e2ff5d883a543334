"""Chains and searches as records of the journal."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from landing_cli.tour.records import ChainStatus, FlybyChain, SearchOutcome
from landing_cli.tour.run_records import ChainPath
from landing_cli.tour.stored_chains import (
    DEPTH_COLUMNS,
    FLYBY_COLUMNS,
    LEG_COLUMNS,
    PATH_COLUMNS,
    depths_of,
    flybys_of,
    legs_of,
    table_of,
    unfit,
)
from landing_cli.tour.stored_words import choice

Arrays = dict[str, NDArray[Any]]


def chain_to_arrays(chain: FlybyChain, path: ChainPath | None = None) -> Arrays:
    """Encode a chain for the journal.

    Parameters
    ----------
    chain : FlybyChain
        What was found.
    path : ChainPath, optional
        Its flight.

    Returns
    -------
    dict of arrays
    """
    facts = {
        "status": chain.status,
        "message": chain.message,
        "targets": chain.targets,
        "departure_t_s": chain.departure_t_s,
    }
    arrays: Arrays = {
        "facts": np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8),
        "legs": table_of(chain.legs, LEG_COLUMNS),
        "flybys": table_of(chain.flybys, FLYBY_COLUMNS),
    }
    if chain.nbody_legs is not None:
        arrays["nbody_legs"] = table_of(chain.nbody_legs, LEG_COLUMNS)
    if path is not None:
        arrays |= {f"path_{column.name}": getattr(path, column.name) for column in PATH_COLUMNS}
    return arrays


def chain_from_arrays(arrays: Mapping[str, NDArray[Any]]) -> tuple[FlybyChain, ChainPath | None]:
    """Decode what `chain_to_arrays` encoded.

    Parameters
    ----------
    arrays : mapping of arrays
        A journal record.

    Returns
    -------
    FlybyChain
    ChainPath or None

    Raises
    ------
    InputRefused
        If it is not of this version's types and shapes.
    """
    try:
        facts = json.loads(np.asarray(arrays["facts"], dtype=np.uint8).tobytes())
        targets = tuple(map(str, facts["targets"]))
        chain = FlybyChain(
            float(facts["departure_t_s"]),
            legs_of(arrays["legs"], targets),
            legs_of(arrays["nbody_legs"], targets) if "nbody_legs" in arrays else None,
            flybys_of(arrays["flybys"], targets),
            choice(facts["status"], get_args(ChainStatus)),
            str(facts["message"]),
        )
        names = [column.name for column in PATH_COLUMNS]
        path = {name: arrays[f"path_{name}"] for name in names} if "path_t_s" in arrays else None
        return chain, None if path is None else ChainPath(**path)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise unfit(f"a journal record is not of this version: {error}") from error


def outcome_to_arrays(outcome: SearchOutcome) -> Arrays:
    """Encode what a search found for the journal.

    Parameters
    ----------
    outcome : SearchOutcome
        Hints, and how far the search looked.

    Returns
    -------
    dict of arrays
    """
    arrays: Arrays = {"depths": table_of(outcome.depths, DEPTH_COLUMNS)}
    chains = {str(i): chain for i, chain in enumerate(outcome.chains)}
    if outcome.nearest is not None:
        chains["nearest"] = outcome.nearest
    for key, chain in chains.items():
        arrays |= {f"{key}/{name}": value for name, value in chain_to_arrays(chain).items()}
    return arrays


def outcome_from_arrays(arrays: Mapping[str, NDArray[Any]]) -> SearchOutcome:
    """Decode what `outcome_to_arrays` encoded.

    Parameters
    ----------
    arrays : mapping of arrays
        A journal record.

    Returns
    -------
    SearchOutcome

    Raises
    ------
    InputRefused
        If it is not of this version's types and shapes.
    """
    parts: dict[str, Arrays] = {}
    for name, value in arrays.items():
        key, _, rest = name.partition("/")
        if rest:
            parts.setdefault(key, {})[rest] = value
    nearest = chain_from_arrays(parts.pop("nearest"))[0] if "nearest" in parts else None
    chains = tuple(chain_from_arrays(parts[key])[0] for key in sorted(parts, key=int))
    return SearchOutcome(chains, depths_of(arrays["depths"]), nearest)
