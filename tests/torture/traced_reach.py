"""The real ``reach``, told to note the chunks that it begins and to die on one facet (see ``programs``).

``TORTURE_TRACE=FILE TORTURE_DEADLY=ITEM python traced_reach.py run SCENARIO -o PATH ...``
"""

from __future__ import annotations

from collections.abc import Sequence

from landing_cli.cli import app, guard


def solve_items(prepared, facets, items):  # type: ignore[no-untyped-def]
    """Solve, as the pipeline would, after a word to the torturer."""
    from programs import die_on, note_chunk

    from landing_cli.reach import facet_work

    note_chunk(f"traverse/{items[0]}")
    die_on(items)
    return facet_work.solve_items(prepared, facets, items)


def command(arguments: Sequence[str]) -> int:
    """Run ``reach`` with the pipeline's solver replaced by the one above."""
    from landing_cli.parallel.blas import pin_blas_threads

    pin_blas_threads()  # as the command does before it imports the pipeline
    from landing_cli.reach import pipeline

    pipeline.solve_items = solve_items
    return app.main("reach", arguments)


if __name__ == "__main__":
    import traced_reach  # the workers must find the solver in a module of that name

    guard.run_process(traced_reach.command)
