"""`auvsim manoeuvre`: checks everything, runs manoeuvres one after another, leaves a log and a picture of each."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from auvsim.base import schema
from auvsim.base.errors import InputError, unknown_name
from auvsim.cli import options, products, report
from auvsim.cli import run as running
from auvsim.missions.manoeuvres import metrics as manoeuvre_metrics
from auvsim.missions.manoeuvres.settings import ManoeuvreSettings, OptimalSettings
from auvsim.simulation import sampling
from auvsim.simulation.scenario import Scenario

KINDS = tuple(model.model_fields["kind"].default for model in schema.members(ManoeuvreSettings))


def plans(arguments: Sequence[str], values: Mapping, seed: int, trial: int) -> dict[str, Scenario]:
    """The scenarios of the manoeuvres that a command line names, by their kinds.

    Args:
        arguments: Kinds, and at most one YAML file of what to pin.
        values: Keys given as options.
        seed: Seed of the trials.
        trial: Number of the trial.

    Raises:
        InputError: One line with what cannot be used.
    """
    files = [Path(name) for name in arguments if name.endswith((".yaml", ".yml"))]
    kinds = [name for name in arguments if not name.endswith((".yaml", ".yml"))]
    if len(files) > 1:
        raise InputError(f"command line: {len(files)} scenario files; give one at most")
    if not kinds:
        raise InputError(f"command line: no manoeuvre; there are {', '.join(KINDS)}")
    for kind in kinds:
        if kind not in KINDS:
            raise unknown_name("manoeuvre", kind, list(KINDS))
        if kinds.count(kind) > 1:
            raise InputError(f"command line: {kind} is given more than once; one log of each kind is written")
    return {kind: _plan(kind, files[0] if files else None, values, seed, trial) for kind in kinds}


def file_of(arguments: Sequence[str]) -> Path | None:
    """The YAML file among the arguments, if there is one."""
    return next((Path(name) for name in arguments if name.endswith((".yaml", ".yml"))), None)


def _plan(kind: str, file: Path | None, values: Mapping, seed: int, trial: int) -> Scenario:
    given = values.get("manoeuvre")
    given = given if isinstance(given, Mapping) else {}
    if given.get("kind", kind) != kind:
        raise InputError(f"command line: --manoeuvre.kind {given['kind']} contradicts the manoeuvre {kind}")
    pinned = {**values, "manoeuvre": {**given, "kind": kind}}
    return options.scenario(file, None, pinned, seed, trial, sampling.manoeuvre_plan(kind))


def run(plans: Mapping[str, Scenario], *, seed: int, trial: int, out: Path) -> int:
    """Runs the manoeuvres, fills the folder and returns the exit code."""
    figures, code = [], 0
    with running.output_folder(out):
        for kind, plan in _ready(plans, seed, trial).items():
            path = out / f"{kind}.nc"
            log = running.simulate(plan, seed, trial, kind, path)
            path.with_suffix(".png").unlink(missing_ok=True)  # of an earlier log
            if log.attributes["status"] == "interrupted":
                print(f"auvsim: interrupted; {path} holds the manoeuvre up to there", file=sys.stderr)
                return 130
            if log.attributes["status"] == "diverged":
                print(f"auvsim: {running.diagnosis(log)}; {path} holds the manoeuvre up to there", file=sys.stderr)
                code = 1
                continue
            products.plots(log, out)
            figures += manoeuvre_metrics.figures(log.vehicle())
    if figures:
        report.manoeuvres(figures)
    return code


def _ready(plans: Mapping[str, Scenario], seed: int, trial: int) -> dict[str, Scenario]:
    """The same plans, each known to run, an optimal manoeuvre designed; nothing is written before."""
    from auvsim.simulation.run import Simulation

    for plan in plans.values():
        if not isinstance(_manoeuvre(plan), OptimalSettings):
            Simulation(plan, seed, trial)
    return {
        kind: _designed(plan, found, seed) if isinstance(found := _manoeuvre(plan), OptimalSettings) else plan
        for kind, plan in plans.items()
    }


def _manoeuvre(plan: Scenario) -> Any:
    """The manoeuvre of the only vehicle."""
    return getattr(plan.lone[1].mission, "manoeuvre", None)


def _designed(plan: Scenario, settings: OptimalSettings, seed: int) -> Scenario:
    """The plan with the manoeuvre designed on the planar model fitted at its speed; prints what to expect of it."""
    from auvsim.identification import excitation, information
    from auvsim.physics.planar_fit import fit_planar_model
    from auvsim.vehicles import library

    name, of_vehicle = plan.lone
    model = fit_planar_model(of_vehicle.model, settings.speed, plan.water.density)
    vehicle = library.vehicle(of_vehicle.model)
    if model.shaft_speed_for(settings.fastest) > vehicle.actuation.shaft_limit:
        text = f"the shaft of '{vehicle.model}' cannot hold {settings.fastest:g} m/s"
        raise InputError(f"manoeuvre optimal: {text}")
    bench = excitation.Bench(
        experiment=information.Experiment(model.parameters, of_vehicle.sensors),
        shaft_speed=model.shaft_speed_for,
        rudder_limit=vehicle.actuation.fin_limit,
    )
    if not information.is_warm():
        with report.waiting(running.COMPILING.format("information")):
            bench.approach(settings)
    with report.DesignProgress() as progress:
        found = excitation.design(settings, bench, seed=seed, progress=progress)
    standards = {
        name: bench.carry_out(standard, settings) for name, standard in excitation.standards(settings, bench).items()
    }
    report.information(bench.experiment.free, {"optimal": found.outcome, **standards}, settings.room)
    mission = of_vehicle.mission.model_copy(update={"manoeuvre": found.table})
    return plan.model_copy(update={"vehicles": {name: of_vehicle.model_copy(update={"mission": mission})}})
