"""What makes two runs the same run, and what is different where they are not."""

from __future__ import annotations

import difflib
import re
from dataclasses import asdict, dataclass, field
from typing import Any, Self

SCHEMA_VERSION = 1
LISTED_DIFFERENCES = 8
_COMMENT = re.compile(r"""^([^'"#]*)(?:(?<=\s)|^)#.*$""")  # not within quotes: there it is no comment


@dataclass(frozen=True)
class RunIdentity:
    """Everything that decides a run's numbers; jobs, backend and machine do not.

    Attributes
    ----------
    command : str
        ``reach run``, ``plan bezier``, ...
    scenario : str
        The resolved scenario as text, defaults included.
    shape_sha256 : str
        Hash of the shape file; of a tour, of the catalogue.
    package_version : str
    schema_version : int
        Version of the layout of result files.
    chunk_facets : int
        How many items a chunk of work holds.
    """

    command: str
    scenario: str = field(repr=False)
    shape_sha256: str
    package_version: str
    schema_version: int = SCHEMA_VERSION
    chunk_facets: int = 0

    def as_dict(self) -> dict[str, str | int]:
        """Return the fields by name."""
        return asdict(self)

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> Self:
        """Rebuild an identity from a file.

        Parameters
        ----------
        fields : dict
            By name; more than the known ones are ignored.

        Raises
        ------
        ValueError
            If a field is missing or of the wrong type.
        """
        kinds = {name: int if kind == "int" else str for name, kind in cls.__annotations__.items()}
        wrong = [n for n, kind in kinds.items() if type(fields.get(n)) is not kind]
        if wrong:
            raise ValueError(f"no valid {', '.join(wrong)}")
        return cls(**{name: fields[name] for name in kinds})

    def differences(self, stored: RunIdentity) -> list[str]:
        """Say what changed since the stored run.

        Parameters
        ----------
        stored : RunIdentity
            From the file on disk.

        Returns
        -------
        list of str
            One line a difference, ``what: stored -> now``; empty for the same run.
        """
        lines: list[str] = []
        if self.scenario != stored.scenario:
            lines += _changed_lines(stored.scenario, self.scenario)  # comments change no number
        if self.shape_sha256 != stored.shape_sha256:
            read = "catalogue" if self.command.startswith("tour") else "shape"
            lines.append(f"{read}: sha256 {stored.shape_sha256[:12]}... -> {self.shape_sha256[:12]}...")
        for name in ("command", "package_version", "schema_version", "chunk_facets"):
            before, now = getattr(stored, name), getattr(self, name)
            if now != before:
                lines.append(f"{name.replace('_', ' ')}: {before} -> {now}")
        if len(lines) > LISTED_DIFFERENCES:
            lines[LISTED_DIFFERENCES:] = [f"and {len(lines) - LISTED_DIFFERENCES} more"]
        return lines


def _changed_lines(before: str, now: str) -> list[str]:
    old, new = (_bare_lines(text) for text in (before, now))
    changes = []
    for kind, a, b, c, d in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if kind != "equal":
            gone, come = ("; ".join(map(str.strip, lines)) or "nothing" for lines in (old[a:b], new[c:d]))
            changes.append(f"scenario: {gone} -> {come}")
    return changes


def _bare_lines(text: str) -> list[str]:
    lines = (_COMMENT.sub(r"\1", line).rstrip() for line in text.splitlines())
    return [line for line in lines if line]
