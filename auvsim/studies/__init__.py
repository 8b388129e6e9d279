"""Studies behind the figures of the README, run by `auvsim study NAME`.

A study is a module of this package with a dataclass `Options`, whose fields are the options of its command, and a
function `report(options, progress)` that runs it and returns what to print.
"""

from importlib import import_module
from typing import Any

from auvsim.base.errors import unknown_name

STUDIES = {  # name of the module: its line of help
    "docking": "Random docking trials of the default plan: success, accuracy, contact, consistency of the estimate.",
    "comparison": "The same docking trials with each estimator, in steady and in turning currents.",
    "docking_bound": "The default estimator against the Cramér-Rao bound, relative to the dock, by distance.",
    "envelope": "Docking trials outside the default plan: losses, delays, strong currents, gusts, biases, bursts.",
    "identification": "Fits of planar vehicles with known parameters: coverage, convergence, process noise.",
    "held_out": "Identification of the MuJoCo vehicle, judged by predicting manoeuvres that were held out.",
    "time_steps": "What a time step costs: position after a minute by integrator and rate, contact by rate.",
    "identified_docking": "The same docking trials with the fitted, the identified and a wrong planar model.",
    "formation": "Four vehicles in formation: station keeping, and what the leaders' shape is worth to the follower.",
    "mission_bound": "Followers in MuJoCo against the map of `auvsim bound`, at stations where it sees and is blind.",
    "survey": "Surveys by sonar, with and without loop closures, beside dead reckoning: path errors, NEES, docked.",
}


def load(name: str) -> Any:
    """Returns the module of a study.

    Raises:
        InputError: If there is no such study.
    """
    module = name.replace("-", "_")
    if module not in STUDIES:
        raise unknown_name("study", name, list(STUDIES))
    return import_module(f"{__name__}.{module}")
