"""A ranking for people and other programs: the sites as a table, the facets as a map."""

from __future__ import annotations

from typing import Any

import numpy as np

from landing_cli.body.mesh import facet_areas, facet_centroids
from landing_cli.reach.records import Verdict
from landing_cli.results.maps import WRITERS
from landing_cli.results.surface_map import lon_lat_deg
from landing_cli.results.tables import Table, TableColumn, to_csv, to_json
from landing_cli.results.tree import flag_words
from landing_cli.studies.rank.score import MEASURES, Ranking

MAPS = tuple(WRITERS)


def sites_table(ranking: Ranking) -> Table:
    """Lay the listed sites out as a table, best first.

    Parameters
    ----------
    ranking : Ranking
        The ranking.

    Returns
    -------
    Table
        Rank, facet, place, score, every measure, and what it contributes as ``score_<measure>``: weight
        times its part, so that the contributions add up to the score.
    """
    sites, mesh = ranking.sites, ranking.cases[0].case.asteroid.mesh
    places = lon_lat_deg(facet_centroids(mesh)[sites])
    columns: dict[str, Any] = {
        "rank": np.arange(1, len(sites) + 1),
        "facet": sites,
        "longitude_deg": places[:, 0],
        "latitude_deg": places[:, 1],
        "score": ranking.score[sites],
    }
    for name, (column, _) in MEASURES.items():
        columns[column] = ranking.measures[name][sites]
    for name in MEASURES:
        columns[f"score_{name}"] = ranking.weights[name] * ranking.parts[name][sites]
    columns["area_m2"] = facet_areas(mesh)[sites]
    return Table({name: TableColumn(np.asarray(values)) for name, values in columns.items()})


def to_text(ranking: Ranking, form: str) -> str:
    """Write the listed sites as CSV or JSON.

    Parameters
    ----------
    ranking : Ranking
        The ranking.
    form : {"csv", "json"}
        How.

    Returns
    -------
    str
    """
    return to_csv(sites_table(ranking)) if form == "csv" else to_json(sites_table(ranking))


def to_map(ranking: Ranking, form: str) -> bytes:
    """Write the score and the measures of every facet as a mesh.

    Parameters
    ----------
    ranking : Ranking
        The ranking.
    form : {"ply", "vtp", "obj"}
        How.

    Returns
    -------
    bytes
        ``rank`` is 0 where a facet is not listed; ``verdict`` names the candidates reachable.
    """
    mesh, count = ranking.cases[0].case.asteroid.mesh, len(ranking.score)
    ranks = np.zeros(count, dtype=np.int32)
    ranks[ranking.sites] = np.arange(1, len(ranking.sites) + 1)
    verdict = np.where(ranking.candidates, Verdict.REACHABLE, Verdict.UNREACHABLE).astype("u1")
    columns = {
        "facet": TableColumn(np.arange(count, dtype=np.int32)),
        "verdict": TableColumn(verdict, flag_words(Verdict)),
        "rank": TableColumn(ranks),
        "score": TableColumn(ranking.score),
    }
    for name, (column, _) in MEASURES.items():
        columns[column] = TableColumn(ranking.measures[name])
    return WRITERS[form](mesh, Table(columns))
