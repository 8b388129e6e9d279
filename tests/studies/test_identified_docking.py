"""Trials with each planar model: a short form that pairs them and tells a wrong model."""

import io
from pathlib import Path

from rich.console import Console

from auvsim.identification.fit import DEFAULT_FREE
from auvsim.physics import planar_sets
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.studies.identified_docking import (
    MODELS,
    VEHICLE,
    model_set,
    ratio,
    rms,
    run_one,
    squares,
    table,
    wrong,
)


def test_a_set_of_the_fitted_model_is_as_good_as_it_and_a_wrong_one_worse(tmp_path: Path) -> None:
    """The same parameters by another way give the same estimates to the last bit; paired, so with one trial."""
    path = tmp_path / "same.yaml"
    planar_sets.write(model_set(fit_planar_model(VEHICLE, 1.0).parameters), path)
    study = {model: (run_one(model, path, 1, 0),) for model in MODELS}
    same = ratio(study["identified"], study["fitted"])
    assert (same.value, same.low, same.high) == (1.0, 1.0, 1.0)
    assert rms(squares(study["wrong"])) != rms(squares(study["fitted"]))
    output = io.StringIO()
    Console(width=140, file=output).print(table(study, 1))
    assert "1.000 (1.000-1.000)" in output.getvalue()


def test_a_wrong_model_is_wrong_by_a_fifth_either_way() -> None:
    right, off = fit_planar_model(VEHICLE, 1.0).parameters, wrong(1, 0)
    shares = [getattr(off, name) / getattr(right, name) for name in DEFAULT_FREE]
    assert sorted({round(share, 9) for share in shares}) == [0.8, 1.2]
    assert (off.m, off.Y_vd) == (right.m, right.Y_vd)
    assert wrong(1, 1) != off
