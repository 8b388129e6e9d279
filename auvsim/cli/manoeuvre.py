"""`auvsim manoeuvre`: checks everything, runs manoeuvres one after another, leaves a log and a picture of each."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from auvsim.base import schema
from auvsim.base.errors import InputError, unknown_name
from auvsim.cli import dock, options, products, report
from auvsim.data.log import write
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
    with dock.output_folder(out):
        for kind, plan in _ready(plans, seed, trial).items():
            log = dock.simulate(plan, seed, trial, kind)
            path = out / f"{kind}.nc"
            write(log, path)
            path.with_suffix(".png").unlink(missing_ok=True)  # of an earlier log
            if log.attributes["status"] == "interrupted":
                print(f"auvsim: interrupted; {path} holds the manoeuvre up to there", file=sys.stderr)
                return 130
            if log.attributes["status"] == "diverged":
                print(f"auvsim: {dock.diagnosis(log)}; {path} holds the manoeuvre up to there", file=sys.stderr)
                code = 1
                continue
            products.plots(log, out)
            figures += manoeuvre_metrics.figures(log)
    if figures:
        report.manoeuvres(figures)
    return code


def _ready(plans: Mapping[str, Scenario], seed: int, trial: int) -> dict[str, Scenario]:
    """The same plans, each known to run, an optimal manoeuvre designed; nothing is written before."""
    from auvsim.simulation.trial import Loop

    for plan in plans.values():
        if not isinstance(plan.manoeuvre, OptimalSettings):
            Loop(plan, seed, trial)
    return {
        kind: _designed(plan, plan.manoeuvre, seed) if isinstance(plan.manoeuvre, OptimalSettings) else plan
        for kind, plan in plans.items()
    }


def _designed(plan: Scenario, settings: OptimalSettings, seed: int) -> Scenario:
    """The plan with the manoeuvre designed on the model condensed at its speed; prints what to expect of it."""
    from auvsim.identification import excitation, information
    from auvsim.physics.planar_fit import fit_planar_model
    from auvsim.vehicles import library

    model = fit_planar_model(plan.vehicle.model, settings.speed, plan.world.water_density)
    vehicle = library.vehicle(plan.vehicle.model)
    if model.shaft_speed_for(settings.fastest) > vehicle.shaft_limit:
        text = f"the shaft of '{vehicle.name}' cannot hold {settings.fastest:g} m/s"
        raise InputError(f"manoeuvre optimal: {text}")
    bench = excitation.Bench(
        experiment=information.Experiment(model.parameters, plan.sensors),
        shaft_speed=model.shaft_speed_for,
        rudder_limit=vehicle.allocation.limit,
    )
    if not information.is_warm():
        with report.waiting(dock.COMPILING.format("information")):
            bench.approach(settings)
    with report.DesignProgress() as progress:
        found = excitation.design(settings, bench, seed=seed, progress=progress)
    standards = {
        name: bench.carry_out(standard, settings) for name, standard in excitation.standards(settings, bench).items()
    }
    report.information(bench.experiment.free, {"optimal": found.outcome, **standards}, settings.room)
    return plan.model_copy(update={"manoeuvre": found.table})
