"""Imports run one way: a module of auvsim knows only those before it, and estimators know nothing of auvsim."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LINES = """
    renderer errors settings files yaml_text schema frames truth randomness interpolation current_settings currents
    forces layout pointers fluid hydrodynamics allocation library condense planar_sets scenery world scenes planar_world
    acoustics sensors navigation guidance control manoeuvre_settings manoeuvres scenario distributions sampling netcdf
    log dock_frame recorder trial environment metrics manoeuvre_metrics drawing plots manoeuvre_plots video export
    identification campaign reproduce cli
"""
ORDER = LINES.split()
MAY_IMPORT_ESTIMATORS = (
    "condense",
    "planar_sets",
    "planar_world",
    "navigation",
    "metrics",
    "plots",
    "identification",
    "campaign",
    "reproduce",
)
MODULES = sorted(path for package in ("auvsim", "estimators") for path in (ROOT / package).rglob("*.py"))


def imports(tree: ast.AST) -> Iterator[str]:
    """Dotted names of all that is imported, in functions and under TYPE_CHECKING too; `from a import b` gives a.b."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def violations(module: str, source: str) -> list[str]:
    """Imports of a module (`auvsim.sensors.usbl`) that its place does not allow."""
    package, name = [*module.split("."), "__init__"][:2]
    wrong = []
    for imported in imports(ast.parse(source)):
        root, part = [*imported.split("."), ""][:2]
        if package == "estimators":
            allowed = root not in ("auvsim", "mujoco", "dm_control")
        elif root == "estimators":
            allowed = name in MAY_IMPORT_ESTIMATORS
        elif root == "auvsim" and part in ORDER and name != "__init__":
            before = ORDER.index(part) <= ORDER.index(name)
            allowed = before or imported.startswith("auvsim.sensors.reading.")  # a plain value, known to all
        else:
            # The package itself holds its version, chooses the renderer, and nothing else to import.
            allowed = root != "auvsim" or imported in (
                "auvsim",
                "auvsim.__version__",
                "auvsim.renderer.choose_renderer",
            )
        wrong += [] if allowed else [imported]
    return wrong


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_run_one_way(path: Path) -> None:
    """Every module keeps to the order, and every module of auvsim has a place in it."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    if parts[0] == "auvsim" and parts[1] != "__init__":
        assert parts[1] in ORDER, f"give auvsim.{parts[1]} a place in ORDER"
    assert violations(".".join(parts), path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("module", "source", "wrong"),
    [
        ("auvsim.frames", "from auvsim.world import World", ["auvsim.world.World"]),
        ("auvsim.frames", "from auvsim import world", ["auvsim.world"]),
        ("auvsim.world", "from auvsim.frames import flip", []),
        ("auvsim.sensors.usbl", "def f():\n    import auvsim.trial", ["auvsim.trial"]),
        ("auvsim.acoustics", "from auvsim.sensors.reading import Reading", []),
        ("auvsim.acoustics", "from auvsim.sensors.usbl import Usbl", ["auvsim.sensors.usbl.Usbl"]),
        ("auvsim.trial", "import estimators.ekf", ["estimators.ekf"]),
        ("auvsim.navigation", "import estimators.ekf", []),
        ("auvsim.__init__", "from auvsim.trial import run_trial", ["auvsim.trial.run_trial"]),
        ("auvsim.frames", "from auvsim import nowhere", ["auvsim.nowhere"]),
        ("estimators.ekf", "if TYPE_CHECKING:\n    from auvsim.log import TrialLog", ["auvsim.log.TrialLog"]),
        ("estimators.ekf", "import mujoco", ["mujoco"]),
        ("estimators.ekf", "import numpy", []),
    ],
)
def test_wrong_imports_are_seen(module: str, source: str, wrong: list[str]) -> None:
    """The check above sees what it is meant to see."""
    assert violations(module, source) == wrong
