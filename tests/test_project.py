"""What the README, the continuous integration and the version say agrees."""

import os
import re
import subprocess
import tomllib
from pathlib import Path

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


def test_the_printed_log_format_is_the_log_format():
    from auvsim.data.log import table_markdown

    assert (ROOT / "docs" / "log_format.md").read_text() == table_markdown() + "\n"


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
