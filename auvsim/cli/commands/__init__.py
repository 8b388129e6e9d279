"""The commands: what each takes, in the words of its help, and what it calls.

What draws and computes is imported when a command runs, so that `--help` answers at once.
"""

from typing import Annotated

import tyro

from auvsim.cli.commands.campaigns import Campaign, Report, Reproduce, Stress, Study
from auvsim.cli.commands.logs import Compare, Estimate, Export, Identify
from auvsim.cli.commands.planning import Bound, Floor, Formation, Modem, ShowVehicle
from auvsim.cli.commands.runs import Dock, Manoeuvre, Run, ScenarioText
from auvsim.cli.commands.views import Metrics, Plot, Video

Command = (
    Dock
    | Run
    | Bound
    | Floor
    | Campaign
    | Stress
    | Report
    | Manoeuvre
    | Identify
    | Estimate
    | Compare
    | Export
    | Video
    | Plot
    | Metrics
    | Reproduce
    | Formation
    | Modem
    | Study
    | Annotated[ShowVehicle, tyro.conf.subcommand("vehicle")]
    | Annotated[ScenarioText, tyro.conf.subcommand("scenario")]
)

TAKE_SCENARIO_KEYS = {
    "dock": Dock, "run": Run, "bound": Bound, "floor": Floor, "manoeuvre": Manoeuvre, "scenario": ScenarioText,
}  # fmt: skip
TAKE_NAMES = {
    "identify": ("--steps",),
    "estimate": ("--estimator", "--sensors"),
    "video": ("--camera",),
}  # options that take several names
