"""The estimators by their kinds, and how one is made for a vehicle."""

from dataclasses import replace
from typing import Any

from auvsim.base import plugins
from auvsim.base.errors import AuvsimError, InputError
from auvsim.navigation import docking, reckoning
from auvsim.navigation.navigator import Navigator, NavigatorFactory, NavigatorSetup

_SHIPPED: tuple[NavigatorFactory, ...] = (
    docking.augmented_ekf,
    docking.ukf,
    docking.imm,
    docking.imm_biased,
    docking.paper,
    docking.current_only,
    docking.delay_only,
    docking.regular_ekf,
)
ESTIMATORS: dict[str, NavigatorFactory] = {  # of docking
    factory.__name__: factory for factory in _SHIPPED
}
GENERAL: dict[str, NavigatorFactory] = {"dead_reckoning": reckoning.dead_reckoning}  # that need no dock
ALL = {**ESTIMATORS, **GENERAL}


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
    except Exception as error:  # a user's factory may fail in any way
        raise InputError(f"estimator '{kind}' cannot be made: {type(error).__name__}: {error}") from error
    for needed in ("update", "reset", "states"):
        if not hasattr(navigator, needed):
            raise InputError(f"estimator '{kind}' made a {type(navigator).__name__} without {needed}; see Navigator")
    return navigator
