"""Registry of the controllers by kind."""

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any

from pydantic import Discriminator, Tag

from auvsim.base import plugins
from auvsim.base.errors import AuvsimError, InputError
from auvsim.base.settings import OwnPart, tag_by_kind
from auvsim.control.controller import Controller, ControllerSetup
from auvsim.control.hovering import HoveringController, HoveringSettings
from auvsim.control.torpedo import Autopilot, AutopilotSettings


class OwnController(OwnPart):
    """A controller of the user's own."""


ControlSettings = Annotated[
    Annotated[AutopilotSettings, Tag("AutopilotSettings")]
    | Annotated[HoveringSettings, Tag("HoveringSettings")]
    | Annotated[OwnController, Tag("OwnController")],
    Discriminator(tag_by_kind(AutopilotSettings, HoveringSettings, OwnController)),
]
CONTROLLERS: dict[str, Callable[[ControllerSetup], Any]] = {"torpedo": Autopilot, "hovering": HoveringController}


def build(kind: str, setup: ControllerSetup) -> Controller:
    """Makes the controller of a kind, or a user's own as `package.module:Class`.

    Raises:
        InputError: there is none, or it cannot be made.
    """
    made = plugins.find("controller", kind, CONTROLLERS)
    if plugins.is_own(kind):
        where = f"controller '{kind}': settings"
        setup = replace(setup, settings=plugins.settings_of(made, setup.settings.settings, where))
    try:
        part = made(setup)
    except AuvsimError:
        raise
    except (Exception, SystemExit) as error:  # a user's class may fail in any way
        raise InputError(f"controller '{kind}' cannot be made: {type(error).__name__}: {error}") from error
    plugins.require(f"controller '{kind}'", part, "observe", "command", "heading", "depth")
    return part
