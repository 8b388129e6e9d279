"""The log format with what the shipped parts add to it: `python -m auvsim.simulation.log_format` prints the page."""

from dataclasses import replace

from auvsim.acoustics.usbl import Usbl
from auvsim.base.randomness import stream
from auvsim.data.description import table_markdown
from auvsim.data.variables import ESTIMATE, MISSION, Table, Variable
from auvsim.missions.registry import MISSIONS
from auvsim.navigation import sonar_log
from auvsim.navigation.estimate import PLANAR_STATES
from auvsim.sensors import registry
from auvsim.vehicles import library


def markdown(model: str = "remus100") -> str:
    """The log format as Markdown: the general tables, then those of each shipped sensor, mission and estimator.

    Args:
        model: of the vehicle whose actuation is shown.

    Raises:
        InputError: there is no such vehicle.
    """
    return table_markdown(shipped(model))


def shipped(model: str) -> dict[str, Table]:
    """By their headings, the variables that the shipped parts add to the general tables."""
    vehicle = library.vehicle(model)
    demands = {d.name: Variable((), "float64", d.units, d.long_name) for d in vehicle.actuation.demands}
    states, units = ", ".join(PLANAR_STATES), ", ".join(PLANAR_STATES.values())
    mean = replace(ESTIMATE["mean"], units=units, long_name=f"mean of {states}")
    tables: dict[str, Table] = {}
    for kind, sensor in registry.SENSORS.items():
        made = registry.build(kind, sensor.Settings(), stream(0, 0, kind), name=kind, vehicle=vehicle)
        labels = f": {', '.join(made.value.labels)}" if made.value.labels else ""
        tables[f"Sensor of kind `{kind}`"] = {"value": replace(made.value, long_name=f"{made.value.long_name}{labels}")}
    tables["Fixes of the dock's USBL, `sensors/usbl`"] = {"value": Usbl.value, **Usbl.columns}
    for kind, mission in MISSIONS.items():
        phase = replace(MISSION["phase"], flags=mission.phases)
        tables[f"Mission of kind `{kind}`"] = {"phase": phase, **mission.variables}
    tables["Estimators of the planar model"] = {"mean": mean}
    tables |= {f"Group `{name}`, of a vehicle that navigates by a sonar": t for name, t in sonar_log.TABLES.items()}
    tables[f"Demands on `{model}`, in `command`"] = demands
    return tables


if __name__ == "__main__":
    print(markdown())
