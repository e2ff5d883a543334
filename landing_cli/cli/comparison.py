"""What ``landing results diff`` asks a mission about two of its results."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any


@dataclass(frozen=True)
class Comparison:
    """Two results of one mission, and the module that compares them.

    Attributes
    ----------
    module : module
        The mission's ``compare_runs``; one of facets lists those that changed too.
    before, after : object
        The runs.
    """

    module: ModuleType
    before: Any
    after: Any

    @property
    def has_facets(self) -> bool:
        """Whether facets can be listed and drawn."""
        return hasattr(self.module, "changed_facets")

    def cases(self) -> list[dict[str, Any]]:
        """Compare what the results share, one row a case."""
        rows: list[dict[str, Any]] = self.module.compare_runs(self.before, self.after)
        return rows

    def with_facets(self, cases: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Add to each case what binds otherwise and the facets that changed, where there are facets."""
        if not self.has_facets:
            return cases
        bindings = self.module.binding_changes(self.before, self.after)
        facets: dict[str, list[dict[str, Any]]] = {case["case"]: [] for case in cases}
        for row in self.module.changed_facets(self.before, self.after).rows():
            facets[row.pop("case")].append(row)
        return [
            {**case, "binding_changes": bindings[case["case"]], "facets": facets[case["case"]]}
            for case in cases
        ]

    def csv(self) -> str:
        """Return the changed facets as CSV, or the comparison where there are none."""
        from landing_cli.results.tables import summary_table, to_csv

        if self.has_facets:
            return to_csv(self.module.changed_facets(self.before, self.after))
        return to_csv(summary_table(self.cases()))

    def figures(self, stem: Path) -> Iterator[Path]:
        """Draw the facets that changed; the paths come as the files are written."""
        from landing_cli.reach.figures.difference import write_difference

        return write_difference(self.before, self.after, stem)
