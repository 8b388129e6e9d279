"""What a vehicle of a scenario knows before it starts, for its estimator: in a run, and when its log is replayed."""

from typing import Any

from auvsim.base.errors import at_key
from auvsim.navigation.navigator import NavigatorSetup
from auvsim.navigation.registry import RANGING
from auvsim.physics import motion_models
from auvsim.simulation.scenario import Scenario
from auvsim.simulation.sensor_settings import on_board, rated
from auvsim.vehicles.actuation import Thrusters
from auvsim.vehicles.library import Vehicle


def model_speed(settings: Any) -> float:
    """Speed through the water [m/s] at which an estimator's planar model is fitted."""
    return getattr(settings, "model_speed", 1.0)


def usbl_dock(plan: Scenario, name: str) -> str | None:
    """The structure from which a vehicle is located, or None."""
    return plan.dock_of(name, plan.vehicles[name].sensors.usbl.dock)


def navigator_setup(plan: Scenario, name: str, vehicle: Vehicle, settings: Any = None) -> NavigatorSetup:
    """What the estimator of a vehicle is made from.

    Args:
        plan: The scenario.
        name: Of the vehicle.
        vehicle: Its model.
        settings: Of the estimator; None: the scenario's.

    Raises:
        InputError: The planar model that the settings name cannot be used.
    """
    own, dock = plan.vehicles[name], usbl_dock(plan, name)
    assumed = own.estimator if settings is None else settings
    parameters = None
    if not isinstance(vehicle.actuation, Thrusters):
        with at_key(f"vehicles.{name}.estimator.model"):
            parameters = motion_models.assumed(assumed.model, own.model, model_speed(assumed), plan.water.density)
    others = tuple(other for other in plan.modem_names if other != name)
    return NavigatorSetup(
        vehicle=name,
        settings=assumed,
        parameters=parameters,
        actuation=vehicle.actuation,
        period=1.0 / plan.rates.filter,
        rates=dict(rated(own.sensors)),
        usbl=own.sensors.usbl,
        dock=plan.structures[dock].pose if dock else None,
        sensors=dict(on_board(own.sensors)),
        modem=own.modem,
        others=others,
        ranging=tuple(n for n in others if n in plan.vehicles and plan.vehicles[n].estimator.kind in RANGING),
        start=plan.start_position(name)[:2],
    )
