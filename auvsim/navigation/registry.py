"""Registry of the estimators by kind."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import chain
from typing import Any

from auvsim.base import plugins
from auvsim.base.errors import AuvsimError, InputError
from auvsim.navigation import docking, following, motion_radius, path_prediction, reckoning, sonar
from auvsim.navigation.navigator import Navigator, NavigatorFactory, NavigatorSetup

_SHIPPED: tuple[NavigatorFactory, ...] = (
    docking.augmented_ekf,
    docking.ukf,
    docking.imm,
    docking.imm_biased,
    docking.robust,
    docking.paper,
    docking.current_only,
    docking.delay_only,
    docking.regular_ekf,
)
ESTIMATORS: dict[str, NavigatorFactory] = {  # of docking
    factory.__name__: factory for factory in _SHIPPED
}
GENERAL: dict[str, NavigatorFactory] = {  # that need no dock
    "dead_reckoning": reckoning.dead_reckoning,
    "sonar": sonar.sonar_reckoning,
    "range_ekf": following.range_ekf,
    "motion_radius": motion_radius.motion_radius,
    "path_prediction": path_prediction.path_prediction,
}
ALL = {**ESTIMATORS, **GENERAL}
RANGING = ("range_ekf", "motion_radius", "path_prediction")  # whose estimates rest on ranges to other vehicles


def build(setup: NavigatorSetup) -> Navigator:
    """Makes the estimator that the settings of a set-up name.

    Raises:
        InputError: there is no such factory, or it does not return a Navigator.
    """
    kind = setup.settings.kind
    factory = plugins.find("estimator", kind, ALL)
    if not callable(factory):
        raise InputError(f"estimator '{kind}' is not callable; it must be factory(setup) -> Navigator")
    if plugins.is_own(kind):
        where = f"estimator '{kind}': settings"
        setup = replace(setup, settings=plugins.settings_of(factory, setup.settings.settings, where))
    try:
        navigator: Any = factory(setup)
    except AuvsimError:
        raise
    except (Exception, SystemExit) as error:  # a user's factory may fail in any way
        raise InputError(f"estimator '{kind}' cannot be made: {type(error).__name__}: {error}") from error
    plugins.require(f"estimator '{kind}'", navigator, "update", "reset", "states")
    states = navigator.states
    if (
        not isinstance(states, Mapping)
        or len(states) < 2
        or not all(isinstance(n, str) for n in chain(*states.items()))
    ):
        raise InputError(
            f"estimator '{kind}': states is {states!r}, not units by name of two states or more, north first"
        )
    return navigator
