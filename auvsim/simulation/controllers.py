"""A vehicle's own controller settings: `controller.yaml` beside its MJCF file, in place of the defaults."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from auvsim.base import yaml_text
from auvsim.base.errors import InputError
from auvsim.control.torpedo import AutopilotSettings
from auvsim.simulation import sampling
from auvsim.vehicles import model_files

FILE = "controller.yaml"


def of_model(model: Any) -> dict[str, Any]:
    """Settings of the controller of a vehicle's model; the defaults, if it has none of its own.

    Args:
        model: name or path; anything else, or a model that there is not, has the defaults.

    Raises:
        InputError: its file is no mapping, or cannot be read.
    """
    defaults = AutopilotSettings().model_dump(mode="json")
    try:
        path = model_files.find("vehicle", model).parent / FILE
        if not path.is_file():
            return defaults
    except (InputError, AttributeError, OSError):  # whoever loads the model says what is wrong with it
        return defaults
    return sampling.merge({"control": defaults}, {"control": _read(path)})["control"]


def layered(base: Mapping, *layers: Mapping) -> dict:
    """`base` with layers on top, one after the other; settings of a vehicle's controller lie between it and them.

    They are those of the last layer that gives the vehicle's model, in the short form of a scenario.
    """
    models = [layer["vehicle"]["model"] for layer in layers if _gives_model(layer)]
    plan = sampling.merge(base, {"control": of_model(models[-1])}) if models else dict(base)
    for layer in layers:
        plan = sampling.merge(plan, layer)
    return plan


def in_full(plan: Mapping) -> dict:
    """A plan in full, whose vehicles have their own models' settings where it gives none."""
    vehicles = {}
    for name, vehicle in plan["vehicles"].items():
        own = of_model(vehicle.get("model", "remus100")) if isinstance(vehicle, Mapping) else None
        given = vehicle.get("control", {}) if own else None
        if not isinstance(given, Mapping):
            vehicles[name] = vehicle
            continue
        vehicles[name] = {**vehicle, "control": sampling.merge({"control": own}, {"control": given})["control"]}
    return {**plan, "vehicles": vehicles}


def _gives_model(layer: Mapping) -> bool:
    vehicle = layer.get("vehicle")
    return isinstance(vehicle, Mapping) and "model" in vehicle


def _read(path: Path) -> Mapping:
    document = yaml_text.load(path)
    if not isinstance(document.value, Mapping):
        raise InputError(
            f"{path}: settings of a controller are a mapping of keys to values, such as `heading_gain: 1.0`"
        )
    return document.value
