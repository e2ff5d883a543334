"""The real ``reach isochrone``, told to note the chunks that it begins and to die on one (see ``programs``).

``TORTURE_TRACE=FILE TORTURE_DEADLY=ITEM python traced_isochrone.py isochrone SCENARIO -o PATH ...``
"""

from __future__ import annotations

from collections.abc import Sequence

from landing_cli.cli import app, guard


def ask(study, questions):  # type: ignore[no-untyped-def]
    """Answer questions of the grid, as the pipeline would, after a word to the torturer."""
    from programs import die_on, note_chunk

    from landing_cli.studies.isochrone import work

    note_chunk(f"grid/{questions['item'][0]}")
    die_on(questions["item"])
    return work.ask(study, questions)


def halve_changes(study, changes):  # type: ignore[no-untyped-def]
    """Look into changes of verdict, likewise."""
    from programs import note_chunk

    from landing_cli.studies.isochrone import work

    note_chunk(f"ends/{changes['item'][0]}")
    return work.halve_changes(study, changes)


def command(arguments: Sequence[str]) -> int:
    """Run ``reach`` with the study's solvers replaced by those above."""
    from landing_cli.parallel.blas import pin_blas_threads

    pin_blas_threads()  # as the command does before it imports the pipeline
    from landing_cli.studies.isochrone import pipeline

    pipeline.ask, pipeline.halve_changes = ask, halve_changes
    return app.main("reach", arguments)


if __name__ == "__main__":
    import traced_isochrone  # the workers must find the solver in a module of that name

    guard.run_process(traced_isochrone.command)
