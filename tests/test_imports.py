"""Imports run one way: a package of auvsim knows only those above it, and estimators know nothing of auvsim."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ORDER = (
    "base", "water", "vehicles", "physics", "data", "acoustics", "sensors", "navigation", "control", "missions",
    "simulation", "analysis", "video", "ros", "identification", "replay", "exchange", "comparison", "campaign",
    "stress", "reproduce", "studies", "cli",
)  # fmt: skip
KNOW_NO_ESTIMATORS = ("base", "water", "vehicles", "data", "acoustics", "sensors", "control", "cli")
ESTIMATORS = ("core", "planar", "docking", "motion_radius", "path_prediction", "formation", "map_path")
PAPERS = ESTIMATORS[2:]  # each stands on core and planar, never on another
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
    """Imports of a module (`auvsim.acoustics.usbl`) that its place does not allow."""
    return [imported for imported in imports(ast.parse(source)) if not allowed(module, imported)]


def allowed(module: str, imported: str) -> bool:
    """Whether a module may import a dotted name."""
    package, name = [*module.split("."), "__init__"][:2]
    root, part = [*imported.split("."), ""][:2]
    if package == "estimators":
        if root in ("auvsim", "mujoco", "dm_control"):
            return False
        if root != "estimators" or part not in ESTIMATORS:
            return True
        if name in PAPERS:
            return part not in PAPERS or part == name
        return name in ESTIMATORS and ESTIMATORS.index(part) <= ESTIMATORS.index(name)
    if root == "estimators":
        return name not in KNOW_NO_ESTIMATORS
    if root != "auvsim":
        return True
    if name in ORDER:
        return (part not in ORDER and part in ("", "__version__", "CACHE_NOTE", "RENDERER_NOTE")) or (
            part in ORDER and ORDER.index(part) <= ORDER.index(name)
        )
    # The package itself chooses the renderer and numba's cache. What else it offers it imports by name when it is first
    # used, so that `import auvsim` stays fast and MuJoCo is imported after that choice. Run as a program, it is the
    # command.
    choices = ("auvsim.base.renderer.choose_renderer", "auvsim.base.compiled.choose_cache")
    return imported in (("auvsim.cli.main",) if name == "__main__" else choices)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_run_one_way(path: Path) -> None:
    """Every module keeps to the order, and every package of auvsim has a place in it."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    if parts[0] == "auvsim" and parts[1] not in ("__init__", "__main__"):
        assert parts[1] in ORDER, f"give auvsim.{parts[1]} a place in ORDER"
    assert len(parts) <= 4, "at most two levels of folders below a package"
    assert violations(".".join(parts), path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("module", "source", "wrong"),
    [
        ("auvsim.base.frames", "from auvsim.physics.world import World", ["auvsim.physics.world.World"]),
        ("auvsim.base.frames", "from auvsim.physics import world", ["auvsim.physics.world"]),
        ("auvsim.physics.world", "from auvsim.base.frames import flip", []),
        ("auvsim.acoustics.usbl", "def f():\n    import auvsim.simulation.run", ["auvsim.simulation.run"]),
        ("auvsim.sensors.dvl", "from auvsim.acoustics.usbl import Usbl", []),
        ("auvsim.acoustics.usbl", "from auvsim.sensors.dvl import Dvl", ["auvsim.sensors.dvl.Dvl"]),
        ("auvsim.control.torpedo", "import estimators.core.ekf", ["estimators.core.ekf"]),
        ("auvsim.navigation.docking", "import estimators.core.ekf", []),
        ("auvsim.__init__", "from auvsim.simulation.run import run", ["auvsim.simulation.run.run"]),
        ("auvsim.base.frames", "from auvsim import nowhere", ["auvsim.nowhere"]),
        ("auvsim.data.recorder", "import auvsim", []),
        ("estimators.core.ekf", "if TYPE_CHECKING:\n    from auvsim.data.log import Log", ["auvsim.data.log.Log"]),
        ("estimators.core.ekf", "import mujoco", ["mujoco"]),
        ("estimators.core.ekf", "import numpy", []),
        ("estimators.core.ekf", "from estimators.planar import model", ["estimators.planar.model"]),
        ("estimators.planar.model", "from estimators.core import ekf", []),
        ("estimators.docking.usbl", "from estimators.planar import model", []),
        ("estimators.formation.bound", "from estimators.docking import usbl", ["estimators.docking.usbl"]),
    ],
)
def test_wrong_imports_are_seen(module: str, source: str, wrong: list[str]) -> None:
    """The check above sees what it is meant to see."""
    assert violations(module, source) == wrong


def at_import(tree: ast.Module) -> Iterator[str]:
    """Dotted names of what a module imports when it is imported itself: not in functions nor for type checkers."""
    for node in tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield from imports(ast.Module([node], []))


def test_a_trial_starts_without_the_large_parts_of_scipy():
    """Of all modules that the loop imports, one after the other: each process of a campaign waits for them.

    Optimisation, interpolation, images and sparse matrices took a quarter of a process's start (0.7 s of 2.8 s).
    """
    known = {path.relative_to(ROOT).with_suffix("").as_posix().replace("/", "."): path for path in MODULES}
    to_do, seen, found = ["auvsim.simulation.run"], set(), set()
    while to_do:
        name = to_do.pop()
        if name in seen:
            continue
        seen.add(name)
        for imported in at_import(ast.parse(known[name].read_text())):
            to_do += [part for part in (imported, imported.rpartition(".")[0]) if part in known]
            found |= {imported} if imported.startswith("scipy") else set()
    assert len(seen) > 150
    assert {name.rpartition(".")[0] for name in found} == {"scipy.special"}
