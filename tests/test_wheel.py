"""The wheel holds all that a trial needs: it is built, installed into a fresh environment and used from elsewhere."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def run(*command: str | Path, folder: Path, **environment: str) -> str:
    """Runs a command in a folder, without this checkout on the path, and returns what it printed."""
    variables = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}
    done = subprocess.run(
        [str(part) for part in command], cwd=folder, env={**variables, **environment}, capture_output=True, text=True
    )
    assert done.returncode == 0, f"{command}: {done.returncode}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the sources as they are."""
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, ROOT, folder=folder)
    (built,) = folder.glob("*.whl")
    return built


def test_wheel_holds_packages_and_models(wheel: Path) -> None:
    """Every module and every model file is inside, and nothing else is."""
    inside = set(zipfile.ZipFile(wheel).namelist())
    sources = {
        path.relative_to(ROOT).as_posix()
        for package in ("auvsim", "estimators")
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    models = {
        f"auvsim/{path.relative_to(ROOT).as_posix()}"
        for path in (ROOT / "models").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert models
    assert {name for name in inside if ".dist-info/" not in name} == sources | models


def test_installed_wheel_runs_a_trial(wheel: Path, tmp_path: Path) -> None:
    """A fresh environment with nothing but the wheel and what it asks for docks from another folder."""
    run(sys.executable, "-m", "venv", "fresh", folder=tmp_path)
    python = tmp_path / "fresh" / "bin" / "python"
    run(python, "-m", "pip", "install", "--quiet", "--no-compile", wheel, folder=tmp_path)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    where = "from auvsim.vehicles import model_files; import estimators; print(model_files.models_folder())"
    models = Path(run(python, "-c", where, folder=elsewhere).strip())
    assert models.is_relative_to(tmp_path / "fresh")

    command = tmp_path / "fresh" / "bin" / "auvsim"
    run(command, "dock", "--seed", "1", "--out", "out", "--no-video", "--duration", "20", folder=elsewhere)
    made = {path.name for path in (elsewhere / "out").iterdir()}
    assert made == {"trial.nc", "summary.json", "track.png", "estimates.png"}
    assert json.loads((elsewhere / "out" / "summary.json").read_text())["docked"] is False  # 300 m in 20 s: never
