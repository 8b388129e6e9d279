"""`auvsim study`: its list, its options, its errors and one study that runs."""

import io
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest

from auvsim import studies
from auvsim.base.errors import InputError
from auvsim.cli import main
from auvsim.cli.parsing import parse


def test_alone_it_lists_the_studies(capsys: pytest.CaptureFixture) -> None:
    assert main(["study"]) == 0
    text = capsys.readouterr().out
    assert all(name in text and line in text for name, line in studies.STUDIES.items())


def test_every_module_with_options_is_registered() -> None:
    """And every study has options, each with a default or a place, and a report."""
    folder = Path(studies.__file__).parent
    modules = {path.stem for path in folder.glob("*.py") if "class Options" in path.read_text()}
    assert modules == set(studies.STUDIES)
    for name in modules:
        study = studies.load(name)
        assert is_dataclass(study.Options)
        assert "jobs" in {field.name for field in fields(study.Options)}
        assert callable(study.report)


@pytest.mark.parametrize("name", studies.STUDIES)
def test_help_tells_the_options(name: str, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as left:
        main(["study", name, "--help"])
    assert left.value.code == 0
    text = capsys.readouterr().out
    assert f"usage: auvsim study {name}" in text
    assert "--jobs" in text


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["docing"],
            "no study 'docing'; there are comparison, docking, docking_bound, envelope, formation, held_out, "
            "identification",
        ),
        (["docking", "--trails", "3"], "Unrecognized options: --trails, 3; see auvsim study docking --help"),
        (["docking", "--trials", "x"], "invalid literal for int() with base 10: 'x'"),
        (["docking", "--trials", "0"], "--trials 0 must be 1 or more"),
        (["docking", "--seed", "-1"], "--seed -1 must be 0 or more"),
        (["held-out", "--jobs", "0"], "--jobs 0 must be 1 or more"),
        (["comparison", "--cells", "calm"], "calm"),
        (["identified_docking", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], said: str, capsys: pytest.CaptureFixture) -> None:
    assert main(["study", *arguments]) == 2
    text = capsys.readouterr().err
    assert text.startswith("auvsim: ")
    assert text.count("\n") == 1
    assert said in text


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_the_message_is_found_in_a_box_of_lines_or_of_hyphens(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(io.BytesIO(), encoding))
    with pytest.raises(InputError, match=r"^Unrecognized options: --trails, 3; see p --help$"):
        parse(studies.load("docking").Options, ["--trails", "3"], "p", "")


def test_a_study_prints_its_table(capsys: pytest.CaptureFixture) -> None:
    """One trial with one estimator in one current."""
    arguments = [
        "comparison",
        "--trials",
        "1",
        "--seed",
        "9",
        "--cells",
        "steady",
        "--estimators",
        "imm",
        "--jobs",
        "1",
    ]
    assert main(["study", *arguments]) == 0
    text = capsys.readouterr().out
    assert "1 docking trials in 0.5 m/s, seed 9" in text
    assert "imm" in text
