"""Registry of the missions by kind, and the settings of each."""

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any

from pydantic import Discriminator, Tag

from auvsim.base import plugins
from auvsim.base.errors import AuvsimError, InputError
from auvsim.base.settings import OwnPart, tag_by_kind
from auvsim.missions import contract
from auvsim.missions.docking.guidance import Docking, DockingSettings
from auvsim.missions.formation.mission import Formation
from auvsim.missions.formation.settings import FormationSettings
from auvsim.missions.hovering.docking import HoveringDocking, HoveringDockingSettings
from auvsim.missions.hovering.hold import Hold, HoldSettings
from auvsim.missions.manoeuvres.mission import Manoeuvre
from auvsim.missions.manoeuvres.settings import ManoeuvreMissionSettings
from auvsim.missions.mission import Mission, MissionSetup
from auvsim.missions.survey.mission import Survey, SurveySettings
from auvsim.missions.track.mission import Track, TrackSettings


class OwnMission(OwnPart):
    """A mission of the user's own."""


MissionSettings = Annotated[
    Annotated[DockingSettings, Tag("DockingSettings")]
    | Annotated[ManoeuvreMissionSettings, Tag("ManoeuvreMissionSettings")]
    | Annotated[TrackSettings, Tag("TrackSettings")]
    | Annotated[HoldSettings, Tag("HoldSettings")]
    | Annotated[HoveringDockingSettings, Tag("HoveringDockingSettings")]
    | Annotated[FormationSettings, Tag("FormationSettings")]
    | Annotated[SurveySettings, Tag("SurveySettings")]
    | Annotated[OwnMission, Tag("OwnMission")],
    Discriminator(
        tag_by_kind(
            DockingSettings,
            ManoeuvreMissionSettings,
            TrackSettings,
            HoldSettings,
            HoveringDockingSettings,
            FormationSettings,
            SurveySettings,
            OwnMission,
        )
    ),
]
MISSIONS: dict[str, type[Mission]] = {
    "docking": Docking,
    "manoeuvre": Manoeuvre,
    "track": Track,
    "hold": Hold,
    "formation": Formation,
    "survey": Survey,
    "hovering_docking": HoveringDocking,
}


def find(kind: str) -> type[Mission] | Callable[[MissionSetup], Any]:
    """The class of a kind, or a user's own as `package.module:Class`.

    Raises:
        InputError: there is none.
    """
    return plugins.find("mission", kind, MISSIONS)


def build(kind: str, setup: MissionSetup) -> Mission:
    """Makes a mission.

    Raises:
        InputError: there is no such kind, or it cannot be made.
    """
    made = find(kind)
    if plugins.is_own(kind):
        setup = replace(setup, settings=plugins.settings_of(made, setup.settings.settings, f"mission '{kind}'"))
    try:
        part = made(setup)
    except AuvsimError:
        raise
    except (Exception, SystemExit) as error:  # a user's class may fail in any way
        raise InputError(f"mission '{kind}' cannot be made: {type(error).__name__}: {error}") from error
    plugins.require(f"mission '{kind}'", part, "phases", "phase", "variables", "finished", "events", "update", "row")
    if plugins.is_own(kind):
        contract.check(kind, part)
    return part
