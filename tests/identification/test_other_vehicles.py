"""Motion models of vehicles that are neither a tanker nor a torpedo: two screws without a rudder, a cubic hull."""

from dataclasses import replace
from pathlib import Path

import mariner
import numpy as np
import pytest
import tanker
import usv

from auvsim import cli
from auvsim.base.errors import InputError
from auvsim.identification.motion import data, fit
from auvsim.identification.motion.choice import LUCK, NEAR, Folds, choose
from auvsim.identification.motion.identify import identify_motion
from auvsim.identification.readers import read
from auvsim.identification.records import Record
from auvsim.physics import motion_models
from estimators.planar.terms import LABELS, STRUCTURES, THRUSTER, TWIN, TermsProcess, structure

SEA = tanker.Sea(disturbance=2e-3, lag=0.0, filtered=0.0)
KINDS = ("zigzag20", "steps", "multisine", "turns")


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Logs of the vehicle with two screws."""
    folder = tmp_path_factory.mktemp("usv")
    return [tanker.write(folder / f"{kind}.csv", usv.sail(kind, 4, SEA, 150.0).log) for kind in KINDS]


def test_two_screws_steer_without_a_rudder(logs: list[Path]) -> None:
    """The moment of the screws' difference comes out within 15 %, and half of the error of going on as it began."""
    readings = read(logs[:3])
    assert any("no rudder: its two shafts steer" in note for note in readings.notes)
    record = readings.records[0]
    run = usv.sail(KINDS[0], 4, SEA, 150.0)
    port, starboard = (run.log[f"n_{side} [rpm]"] * np.pi / 30.0 for side in ("port", "starboard"))
    assert record.thrusters is not None
    inside = slice(2, -2)
    middle = 0.5 * (port[1:] + port[:-1]), 0.5 * (starboard[1:] + starboard[:-1])  # of the interval that it drives
    np.testing.assert_allclose(record.inputs[inside, 1], 0.5 * (middle[0] + middle[1])[inside.start : -1], rtol=1e-3)
    np.testing.assert_allclose(record.thrusters[inside, 0], 0.5 * (middle[0] - middle[1])[inside.start : -1], atol=0.05)
    found = identify_motion(readings, read(logs[3:]), quick=True)
    assert found.judged.share[found.place] < 0.5 * found.none[found.place]
    p = usv.parameters(4)
    expected = 2.0 * p["arm"] * p["T"] / p["I"]
    assert found.fit.coefficients["yaw twin n|n|"] == pytest.approx(expected, rel=0.15)
    assert found.planar is None  # the docking filters' model steers by a rudder
    assert not any(term.split()[-1] in ("d", "uud", "n|n|d", "nud") for term in found.fit.structure.terms)


def test_the_command_takes_two_shafts(logs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A model that a filter takes with all its inputs; one shaft alone is no pair, and says which is lacking."""
    out = tmp_path / "o"
    assert cli.main(["identify", str(logs[1]), "--out", str(out), "--quick"]) == 0
    process = motion_models.read(out / motion_models.NAME).process()
    x = np.array([0.0, 0.0, 0.0, 1.2, 0.0, 0.0, 0.0, 0.0])
    turned = [process.evaluate(x, (0.0, 80.0, 0.0, 0.0, apart, 0.0), 2.0)[5] for apart in (20.0, -20.0)]
    assert turned[0] > 0.02
    assert turned[1] < -0.02
    assert not (out / "parameters.yaml").exists()
    rows = [line.split(",") for line in logs[1].read_text().splitlines()]
    alone = tmp_path / "alone.csv"
    at = rows[0].index("n_port [rpm]")
    alone.write_text("\n".join(",".join(cell for k, cell in enumerate(row) if k != at) for row in rows))
    capsys.readouterr()
    assert cli.main(["identify", str(alone), "--out", str(out)]) == 2
    assert "no column is the rudder" in capsys.readouterr().err


def test_the_command_takes_a_side_thruster(tmp_path: Path) -> None:
    """Thrust aside and its moment come out within 35 %, in a file that a filter takes.

    What a smoother makes of pushes of 12 s, and other terms that are averaged, take 20 % of it; orders that are held,
    taken for samples of a slow sensor, half and more.
    """
    runs = [usv.sail(kind, 7, SEA, 150.0, bow=True) for kind in KINDS[:3]]
    paths = [str(tanker.write(tmp_path / f"{run.kind}.csv", run.log)) for run in runs]
    out = tmp_path / "o"
    assert cli.main(["identify", *paths[:2], "--holdout", paths[2], "--out", str(out), "--quick"]) == 0
    found = motion_models.read(out / motion_models.NAME)
    p, process = usv.parameters(7), found.process()
    x = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    pushed = [process.evaluate(x, (0.0, 80.0, 0.0, 0.0, 0.0, t), 1e-3)[3:6] for t in (90.0, -90.0)]
    expected = 2.0 * usv.BOW * 90.0**2 * np.array([1.0 / p["m_v"], usv.BOW_ARM / p["I"]]) * 1e-3
    np.testing.assert_allclose((pushed[0] - pushed[1])[1:], expected, rtol=0.35)


def test_terms_of_shafts_are_those_of_one_where_both_turn_alike() -> None:
    """Two shafts at one speed move the vehicle bit for bit as one shaft does; a thruster pushes by its square."""
    values = {"surge n|n|": 1e-4, "surge |n|u": -1e-3, "yaw n|n|d": 1e-5} | dict.fromkeys((*TWIN, *THRUSTER), 1e-4)
    process = TermsProcess(values, np.zeros(8))
    x = np.array([0.0, 0.0, 0.2, 1.1, 0.1, 0.05, 0.0, 0.0])
    np.testing.assert_array_equal(process.evaluate(x, (0.1, 60.0), 0.1), process.evaluate(x, (0.1, 60.0, 0, 0, 0), 0.1))
    pushed = [process.evaluate(x, (0.0, 0.0, 0.0, 0.0, 0.0, t), 1e-6) for t in (10.0, -20.0, 0.0)]
    moved = [(one - pushed[2])[4] / 1e-6 for one in pushed[:2]]
    np.testing.assert_allclose(moved, [1e-4 * 100.0 * (1.0 + 1.1), -1e-4 * 400.0 * (1.0 + 1.1)], rtol=1e-4)


def test_a_step_that_went_astray_does_not_lead_the_next() -> None:
    """Longer segments begin at the guess that runs the likeliest; fits without a part begin as those of the whole."""
    runs = [tanker.sail(kind, 8, SEA._replace(disturbance=2e-4), 150.0, ship=mariner.ship(8)) for kind in KINDS[:3]]
    motions = [_motion(run) for run in runs]
    folds = Folds(motions)
    kept = STRUCTURES[3]
    first, short = (folds.fit(kept, step, -1) for step in fit.STEPS[:2])
    assert short.begun == fit.STEPS[0]
    assert fit.segments(motions, [first, short], fit.STEPS[2]).begun == fit.STEPS[1]
    yaw = np.array([term.startswith("yaw") for term in kept.terms])
    astray = replace(short, values=np.where(yaw, -1.0, 1.0) * short.values)
    found = fit.segments(motions, [first, astray], fit.STEPS[2])
    assert found.begun == fit.STEPS[0]
    assert found.converged
    assert fit.off(motions, found) < 1.05 * fit.off(motions, first)
    folds._fits[kept.terms, fit.STEPS[2], -1] = found
    assert folds.fit(kept, fit.STEPS[2], 0).begun == fit.STEPS[0]


def _motion(run: tanker.Run) -> data.Motion:
    columns = ("north [m]", "east [m]", "heading [deg]", "surge [m/s]", "sway [m/s]", "yaw_rate [deg/s]")
    factors = np.array([1.0, 1.0, np.pi / 180.0, 1.0, 1.0, np.pi / 180.0])
    measured = np.full((len(run.times), 8), np.nan)
    measured[:, :6] = np.column_stack([run.log[name] for name in columns]) * factors
    measured[:, 2] = np.unwrap(measured[:, 2])
    inputs = np.column_stack([np.radians(run.log["rudder [deg]"]), run.log["n [rpm]"] * np.pi / 30.0])
    deviations = np.array([0.05, 0.05, 0.004, 0.02, 0.02, 0.004, 1.0, 1.0])
    record = Record(name=run.kind, times=run.times, inputs=inputs, measured=measured, deviations=deviations)
    return data.prepare([record], coarsest=0.5)[0]


def test_an_average_is_the_mean_of_its_parts() -> None:
    """By weights, with zeros for terms that one lacks; its covariance that of a mixture of two normal densities."""
    runs = [tanker.sail(kind, 3, tanker.Sea(disturbance=2e-4), 120.0) for kind in KINDS[:2]]
    motions = [_motion(run) for run in runs]
    one = fit.least_squares(motions, structure("a", "1 u", "v r", "r uud"))
    other = fit.least_squares(motions, structure("b", "1 u n|n|", "v r", "v r uud"))
    both = fit.average([one, other], [1.0, 3.0])
    np.testing.assert_allclose(both.vector, 0.25 * one.vector + 0.75 * other.vector)
    assert set(both.structure.terms) == set(other.structure.terms)
    assert both.structure.terms == tuple(t for t in LABELS if t in both.structure.terms)
    generator = np.random.default_rng(1)
    draws = []
    for part, count in ((one, 50_000), (other, 150_000)):
        own = [both.structure.terms.index(term) for term in part.structure.terms]
        x = np.zeros((count, len(both.values)))
        x[:, own] = generator.multivariate_normal(part.values, fit.covariance(part), count, method="cholesky")
        draws.append(x)
    sampled = np.cov(np.concatenate(draws).T)
    size = np.sqrt(np.diag(sampled))
    np.testing.assert_allclose(fit.covariance(both) / np.outer(size, size), sampled / np.outer(size, size), atol=0.02)


def test_a_rudder_that_stays_is_refused_unless_shafts_steer(logs: list[Path]) -> None:
    """Two shafts at one speed throughout teach no more than a rudder that stays."""
    readings = read(logs[:1])
    record = readings.records[0]
    still = replace(record, thrusters=np.zeros_like(record.thrusters))
    with pytest.raises(InputError, match="the rudder stays"):
        identify_motion(replace(readings, records=(still,)))


def test_few_stretches_count_by_what_they_are_worth() -> None:
    """Whole records of two make no jackknife: then intervals are those of the squares, by what these are worth."""
    runs = [tanker.sail(kind, 4, SEA._replace(disturbance=2e-4), 100.0, ship=mariner.ship(4)) for kind in KINDS[1:3]]
    motions = [_motion(run) for run in runs]
    kept = structure("few", "1 u|u| n|n|", "v ur uud", "v r uud")
    first = fit.least_squares(motions, kept)
    found = fit.segments(motions, [first], fit.STEPS[3])
    assert len(found.blocks) == 2
    assert found.worth == pytest.approx(fit.ALIKE * motions[0].duration)
    alone = found.worth / np.diag(found.information)  # each variance if the others were known: the least that it can be
    assert (np.diag(fit.covariance(found)) > 0.99 * alone).all()


def test_what_comes_near_is_averaged(logs: list[Path]) -> None:
    """Of all that converged within twice the least error, by the inverse of errors to the fourth."""
    motions = data.prepare(read(logs[:2]).records, coarsest=data.QUICK)
    found = choose(motions, STRUCTURES[2:4], quick=True)
    assert found.chosen.step == fit.AVERAGE
    singles = [c for c in found.candidates if c.step != fit.AVERAGE]
    assert set(map(id, found.averaged)) == {
        id(c) for c in singles if c.converged and c.error <= NEAR * found.alone.error
    }  # fmt: skip
    for fold in (-1, 0):
        parts = [found.folds.fit(c.structure, c.step, fold).vector for c in found.averaged]
        weights = np.array([1.0 / c.error**4 for c in found.averaged])
        mean = found.folds.fit(found.chosen.structure, fit.AVERAGE, fold).vector
        np.testing.assert_allclose(mean, weights @ parts / weights.sum(), rtol=1e-9, atol=1e-15)
    assert found.mark(found.chosen) == "chosen"
    assert found.mark(found.averaged[0]) == "averaged"
    assert found.chosen.error <= (1.0 + LUCK) * found.alone.error
