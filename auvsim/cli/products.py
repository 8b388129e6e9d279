"""What a log is turned into: plots, video and summary, each written whole or not at all."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.data.log import TrialLog, read

NO_OPENGL = "no video: OpenGL is missing; apt-get install libegl1 libgl1, then `auvsim video {log}` makes it"


def plots(log: TrialLog, folder: Path) -> None:
    """Draws track.png and estimates.png; of a manoeuvre one picture of its name."""
    from auvsim.analysis import manoeuvre_plots, plots
    from auvsim.missions.manoeuvres import laws as manoeuvres
    from auvsim.missions.manoeuvres import metrics as manoeuvre_metrics

    pictures = ((plots.track, "track.png"), (plots.estimates, "estimates.png"))
    if manoeuvre_metrics.is_manoeuvre(log):
        pictures = ((manoeuvre_plots.manoeuvre, f"{manoeuvres.name(manoeuvre_metrics.settings(log))}.png"),)
    for draw, name in pictures:
        with whole(folder / name) as partial:
            draw(log, partial)


def video(log: TrialLog, folder: Path, *, speed: float | None = None, cameras: Sequence[str] = ()) -> None:
    """Draws docking.mp4, with a progress bar.

    Raises:
        DrawingError: Without OpenGL.
    """
    from auvsim import video
    from auvsim.cli.report import VideoProgress

    with VideoProgress() as progress, whole(folder / "docking.mp4") as partial:
        video.render(log, partial, speed=speed, cameras=cameras, progress=progress)


def still(log: TrialLog, folder: Path, *, path: Path, time: float | None = None, cameras: Sequence[str] = ()) -> None:
    """Draws one picture, wherever it is to be.

    Raises:
        DrawingError: Without OpenGL.
    """
    from auvsim import video

    video.still(log, path, time, cameras=cameras)


def summary(log: TrialLog, folder: Path) -> dict[str, Any]:
    """Writes summary.json and returns what it holds."""
    from auvsim.missions.docking import metrics
    from auvsim.missions.manoeuvres import metrics as manoeuvre_metrics

    of_manoeuvre = manoeuvre_metrics.is_manoeuvre(log)
    values = manoeuvre_metrics.summary(log) if of_manoeuvre else metrics.summarise(log).to_dict()
    with whole(folder / "summary.json") as partial:
        partial.write_text(json.dumps(values, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return values


def show_summary(log: TrialLog, folder: Path) -> None:
    """Writes summary.json and prints it as a table."""
    from auvsim.cli import report
    from auvsim.missions.manoeuvres import metrics as manoeuvre_metrics

    values = summary(log, folder)
    if manoeuvre_metrics.is_manoeuvre(log):
        report.manoeuvres(manoeuvre_metrics.figures(log))
    else:
        report.table(values)


def again(path: Path, make: Callable[..., None], /, **options: Any) -> int:
    """Makes something of a log again, beside it: calls `make(log, folder, **options)`."""
    if path.is_dir():
        path = path / "trial.nc"
    log = read(path)
    try:
        make(log, path.parent, **options)
    except OSError as error:
        raise InputError(f"{path.parent}: cannot be written: {error.strerror or error}") from None
    return 0
