"""What the README, the continuous integration and the version say agrees."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

import auvsim

ROOT = Path(__file__).parents[1]


def set_up_lines() -> list[str]:
    """The README's lines that set up an environment."""
    return [line for line in (ROOT / "README.md").read_text().splitlines() if line.startswith("python3 -m venv")]


def test_readme_has_two_set_up_lines() -> None:
    """One line runs a trial, the other the tests; each begins with an environment of its own."""
    first, second = set_up_lines()
    assert "auvsim dock" in first
    assert ".venv/bin/pytest -n " in second  # on all cores


def test_ci_runs_the_readme_line() -> None:
    """`.ci/run` finds exactly the README's second line and runs it last."""
    script = (ROOT / ".ci" / "run").read_text()
    finder = re.search(r"^test_line=\$\((.*)\)$", script, re.MULTILINE)
    assert finder is not None
    found = subprocess.run(["bash", "-c", finder[1]], cwd=ROOT, capture_output=True, text=True, check=True)
    assert found.stdout.strip() == set_up_lines()[1]
    assert script.rstrip().endswith('eval "$test_line"')
    assert os.access(ROOT / ".ci" / "run", os.X_OK)
    subprocess.run(["bash", "-n", ".ci/run"], cwd=ROOT, check=True)


def test_version_is_the_same_everywhere() -> None:
    """Package, project file and citation name one version."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["version"] == auvsim.__version__
    assert str(yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"]) == auvsim.__version__


def test_log_format_in_the_documentation_is_printed() -> None:
    """The page is what `python -m auvsim.simulation.log_format` prints."""
    from auvsim.simulation.log_format import markdown

    assert (ROOT / "docs" / "log_format.md").read_text() == markdown() + "\n"


def test_log_format_has_every_shipped_sensor_and_mission() -> None:
    """Each stands in the page by its kind, with each of its own variables."""
    from auvsim.missions.registry import MISSIONS
    from auvsim.sensors.registry import SENSORS

    page = (ROOT / "docs" / "log_format.md").read_text()
    for kind in SENSORS:
        assert f"Sensor of kind `{kind}`:" in page
    for kind, mission in MISSIONS.items():
        _, _, part = page.partition(f"Mission of kind `{kind}`:")
        assert all(f"| {name} |" in part.split("\n\n")[1] for name in ("phase", *mission.variables))


def test_the_printed_columns_of_a_campaign_are_its_columns():
    from auvsim.campaign.columns import markdown

    assert (ROOT / "docs" / "campaign_table.md").read_text() == markdown() + "\n"


def test_the_plan_in_the_documentation_is_a_plan():
    from auvsim.campaign import plan

    docking, track = (
        plan.parse(yaml.safe_load(part.split("```")[0]))
        for part in (ROOT / "docs" / "campaigns.md").read_text().split("```yaml\n")[1:]
    )
    assert (docking.layout.success, track.layout.success) == ("docked", "success")

    assert len(docking.cells) == 3
    assert docking.variants == ("ekf", "imm")


def test_import_of_the_package_is_light_and_offers_the_names_of_a_first_cell() -> None:
    """`import auvsim` imports neither NumPy nor MuJoCo, and the names are the functions themselves."""
    check = "import auvsim, sys; print({'numpy', 'mujoco', 'numba'} & {*sys.modules}, auvsim.read_log.__module__)"
    printed = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True).stdout
    assert printed.split() == ["set()", "auvsim.data.log"]

    from auvsim.analysis.summary import summarise
    from auvsim.simulation.loading import load_scenario
    from auvsim.simulation.run import run

    assert (auvsim.run, auvsim.load_scenario, auvsim.summarise) == (run, load_scenario, summarise)
    with pytest.raises(AttributeError, match="it offers run, load_scenario, read_log, summarise"):
        auvsim.nothing  # noqa: B018


def test_python_of_the_readme_runs() -> None:
    """Its example prints the summary of a docking trial, with the names that it says."""
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    printed = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert ast.literal_eval(printed)["docked"] in (True, False)


def test_files_that_the_documentation_links_to_are_there() -> None:
    """Every relative link of the pages, and every test that the README names beside a figure."""
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "models" / "README.md", *(ROOT / "docs").glob("*.md")]
    for page in pages:
        text = page.read_text()
        for link in re.findall(r"\]\(([^)#:]+)\)", text):
            assert (page.parent / link).exists(), f"{page.name}: {link}"
        for path in re.findall(r"\btests/[\w/]+\.py", text):
            assert (ROOT / path).is_file(), f"{page.name}: {path}"
