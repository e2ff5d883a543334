"""How the validation page writes tables and numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Lay a table out in Markdown, the first column to the left and the others to the right."""
    lines = [f"| {' | '.join(columns)} |", "|---" + "|--:" * (len(columns) - 1) + "|"]
    lines += [f"| {' | '.join(str(cell) for cell in row)} |" for row in rows]
    return "\n".join(lines)


def spread(values: ArrayLike, form: str = "{:.0f}") -> str:
    """Write least, median and greatest of some values; a dash where there is none."""
    array = np.asarray(values, dtype=np.float64)
    array = array[np.isfinite(array)]
    if not array.size:
        return "-"
    return " / ".join(form.format(v + 0.0) for v in (array.min(), np.median(array), array.max()))


def percent(part: float, whole: float) -> str:
    """Write a share; a dash where there is nothing to share."""
    return f"{100 * part / whole:.1f} %" if whole else "-"


def exact(value: float) -> str:
    """Write a small number with two digits."""
    return "-" if not np.isfinite(value) else f"{value:.1e}"
