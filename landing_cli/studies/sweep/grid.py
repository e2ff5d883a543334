"""The grid of a sweep: its cells, each a scenario of its own, and the landing cases they ask for.

A cell is the scenario that ``reach run --set key=value ...`` would take: loaded, checked and built by the
same code.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from math import prod
from pathlib import Path

import numpy as np

from landing_cli.body.asteroid import Asteroid
from landing_cli.errors import InputRefused, UsageError
from landing_cli.reach.cases import landing_cases
from landing_cli.reach.records import LandingCase
from landing_cli.scenario.build import Say, Surface, builder_over, read_surface
from landing_cli.scenario.document import Document
from landing_cli.scenario.load import LoadedScenario, load_document
from landing_cli.scenario.schema import Scenario
from landing_cli.scenario.sections import reach_section
from landing_cli.studies.sweep.axes import Axis, named

MOST_CELLS = 5000
TIMES = "reach.tof_s"
# roots of the keys that decide what is reachable, and keys that decide what the facets are
ROOTS = ("body", "spacecraft", "reach")
SURFACE_KEYS = ("body.shape", "body.length_unit", "body.origin")


@dataclass(frozen=True, eq=False)
class Question:
    """A scenario and the axes it is swept over.

    Attributes
    ----------
    document : Document
        The scenario's values before the axes replace some of them.
    source : str
        What to call it in messages.
    beside : Path
        The folder where its shape is searched first.
    axes : tuple of Axis
        The first runs slowest.
    """

    document: Document
    source: str
    beside: Path
    axes: tuple[Axis, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along each axis."""
        return tuple(len(axis.texts) for axis in self.axes)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return prod(self.shape)

    def texts_at(self, cell: int) -> dict[str, str]:
        """Values of a cell as texts, by the axes' names."""
        places = np.unravel_index(cell, self.shape)
        return {axis.name: axis.texts[i] for axis, i in zip(self.axes, places, strict=True)}

    def values_at(self, cell: int) -> dict[str, float | str]:
        """Values of a cell, by the axes' names."""
        places = np.unravel_index(cell, self.shape)
        return {axis.name: axis.values[i] for axis, i in zip(self.axes, places, strict=True)}

    def scenario_at(self, cell: int) -> LoadedScenario:
        """Load the scenario of a cell, as ``--set`` of its values would make it.

        Parameters
        ----------
        cell : int
            The last axis runs fastest.

        Raises
        ------
        InputRefused
            What the values make of the scenario is wrong.
        """
        places = np.unravel_index(cell, self.shape)
        put = [f"{axis.key}={axis.texts[i]}" for axis, i in zip(self.axes, places, strict=True)]
        return load_document(self.document, self.source, self.beside, put, "--over")


@dataclass(frozen=True, eq=False)
class Grid:
    """A sweep with everything that its solver needs.

    Attributes
    ----------
    question : Question
    surface : Surface
        What all cells land on.
    states : tuple of str
        Names of the initial states.
    cases : tuple of LandingCase
        Cell after cell, state after state.
    first : LoadedScenario
        The scenario of the first cell.
    """

    question: Question
    surface: Surface
    states: tuple[str, ...]
    cases: tuple[LandingCase, ...]
    first: LoadedScenario

    @property
    def facets(self) -> int:
        """Facets of the mesh."""
        return len(self.surface.mesh.faces)

    @property
    def solves(self) -> int:
        """How many facets are solved in all."""
        return len(self.cases) * self.facets

    @cached_property
    def make_cases(self) -> Callable[[LoadedScenario], list[LandingCase]]:
        """What makes the landing cases of a cell's scenario, one an initial state."""
        return case_maker(self.surface)


def ask(document: Document, source: str, beside: Path, axes: Sequence[Axis]) -> Question:
    """Put a question: name its axes, and let the times of flight be one where there are several.

    Parameters
    ----------
    document : Document
        The scenario's values.
    source : str
        What to call it in messages.
    beside : Path
        The folder where its shape is searched first.
    axes : sequence of Axis
        At least one.

    Returns
    -------
    Question

    Raises
    ------
    LandingError
        An axis is of no key that decides what is reachable, the scenario is wrong, or there are more
        cells than ``MOST_CELLS``.
    """
    for axis in axes:
        _check_key(axis)
    question = Question(document, source, beside, named(axes))
    _check_size(question)
    reach = reach_section(question.scenario_at(0))
    times = () if reach.tof_s is None else reach.tof_s
    if len(times) > 1 and TIMES not in [axis.key for axis in axes]:
        own = Axis(TIMES, tuple(f"{tof_s:.17g}" for tof_s in times))
        question = replace(question, axes=named([*axes, own]))
        _check_size(question)
    return replace(question, document=_for_reach(document))


def lay_out(question: Question, say: Say = lambda _: None) -> Grid:
    """Load, check and build every cell of a sweep.

    Parameters
    ----------
    question : Question
        From :func:`ask`.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Grid

    Raises
    ------
    LandingError
        A cell's scenario is wrong, an initial state has several times of its own, or an axis changes
        nothing.
    """
    first = question.scenario_at(0)
    surface = read_surface(first)
    make = case_maker(surface, say)
    cases: list[LandingCase] = []
    for cell in range(question.cells):
        cases += make(question.scenario_at(cell))
    states = tuple(state.name for state in reach_section(first).initial_states)
    _check_axes(question, cases, len(states))
    return Grid(question, surface, states, tuple(cases), first)


def case_maker(surface: Surface, say: Say = lambda _: None) -> Callable[[LoadedScenario], list[LandingCase]]:
    """Return what makes the landing cases of a cell's scenario, one an initial state.

    Parameters
    ----------
    surface : Surface
        What all cells land on.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    callable
        From LoadedScenario to a list of LandingCase.
    """
    build = builder_over(surface, say)

    def make(loaded: LoadedScenario) -> list[LandingCase]:
        reach = reach_section(loaded)
        several = [state for state in reach.initial_states if len(reach.times_of(state)) > 1]
        if several:
            raise InputRefused(
                f"initial state {several[0].name} has several times of flight of its own",
                where=loaded.source,
                fix="give it one, or drop it for reach.tof_s, which may be swept",
            )
        return [replace(case, margin=False) for _, case in landing_cases(reach, build(loaded))]

    return make


def fingerprint(case: LandingCase) -> tuple[object, ...]:
    """Everything about a case that decides an answer, and nothing that only names it.

    Parameters
    ----------
    case : LandingCase
        The case.

    Returns
    -------
    tuple
        Equal for cases that ask the same.
    """
    told: list[object] = []
    for field in fields(case):
        value = getattr(case, field.name)
        if isinstance(value, Asteroid):
            told.append(body_fingerprint(value))
        elif isinstance(value, np.ndarray):
            told.append(value.tobytes())
        elif field.name != "name":
            told.append(value)
    return tuple(told)


def body_fingerprint(asteroid: Asteroid) -> tuple[object, ...]:
    """Everything about a body over a known surface that decides an answer."""
    gravity = asteroid.gravity
    return gravity.kind, gravity.params.tobytes(), asteroid.gm_m3_s2, asteroid.rotation_rate_rad_s


def _check_key(axis: Axis) -> None:
    root, where = axis.key.partition(".")[0], f"--over {axis.key}"
    if root in Scenario.model_fields and root not in ROOTS:
        fix = f"sweep keys of {', '.join(ROOTS)}"
        raise UsageError("changes nothing of what is reachable", where=where, fix=fix)
    if axis.key in SURFACE_KEYS:
        fix = "run each surface by itself; `landing results` reads them all"
        raise UsageError("changes the surface, and the facets of a sweep are one", where=where, fix=fix)


def _check_size(question: Question) -> None:
    if question.cells > MOST_CELLS:
        shape = " x ".join(map(str, question.shape))
        fix = f"at most {MOST_CELLS}: take longer steps, or sweep parts of it"
        raise UsageError(f"{shape} = {question.cells} cells", where="--over", fix=fix)


def _check_axes(question: Question, cases: Sequence[LandingCase], states: int) -> None:
    """Refuse an axis along which two values, the others at their first, ask the same."""
    asked = [tuple(map(fingerprint, cases[i : i + states])) for i in range(0, len(cases), states)]
    for place, axis in enumerate(question.axes):
        stride = prod(question.shape[place + 1 :])
        along = [asked[i * stride] for i in range(len(axis.texts))]
        where = f"--over {axis.key}"
        if len(set(along)) == 1:
            raise UsageError(
                "changes nothing of what is reachable: every value asks the same",
                where=where,
                fix="`landing scenario show` tells what each key means",
            )
        first: dict[object, str] = {}
        for one, text in zip(along, axis.texts, strict=True):
            if one in first:
                told = f"{first[one]} and {text} ask the same"
                raise UsageError(told, where=where, fix="give each value once")
            first[one] = text


def _for_reach(document: Document) -> Document:
    """Drop what other missions say: it was checked, and changes no number here."""
    kept = {key: value for key, value in document.tree.items() if key in ("name", *ROOTS)}
    return Document(kept, document.places)
