"""What a log is turned into: plots, video and summary, each written whole or not at all."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.data.log import Log, read

NO_OPENGL = "no video: OpenGL is missing; apt-get install libegl1 libgl1, then `auvsim video {log}` makes it"
VIDEOS = ("docking.mp4", "run.mp4")  # of a docking by one vehicle, and of anything else
MAP, MAP_DATA, SONAR = "feature_map.png", "feature_map.nc", "sonar.png"  # of a vehicle that navigates by a sonar


def is_manoeuvre(log: Log) -> bool:
    """Whether a log is that of one vehicle's manoeuvre."""
    return len(log.vehicles) == 1 and log.vehicle().mission == "manoeuvre"


def plots(log: Log, folder: Path) -> None:
    """Draws track.png and estimates.png; of a manoeuvre one picture of its name, of several vehicles fleet.png.

    Where vehicles have modems also packets.png, where some are in formation formation.png, and of one that navigates by
    a sonar sonar.png, feature_map.png and feature_map.nc.
    """
    from auvsim.analysis import fleet_plots, formation_plots, manoeuvre_plots, network_plots, plots
    from auvsim.missions.manoeuvres import laws
    from auvsim.missions.manoeuvres import metrics as manoeuvre_metrics

    if is_manoeuvre(log):
        vehicle = log.vehicle()
        with whole(folder / f"{laws.name(manoeuvre_metrics.settings(vehicle))}.png") as partial:
            manoeuvre_plots.manoeuvre(vehicle, partial)
        return
    if network_plots.talks(log):
        with whole(folder / "packets.png") as partial:
            network_plots.network(log, partial)
    if len(log.vehicles) > 1:
        with whole(folder / "fleet.png") as partial:
            fleet_plots.fleet(log, partial)
        if formation_plots.in_formation(log):
            with whole(folder / "formation.png") as partial:
                formation_plots.formation(log, partial)
        return
    for draw, name in ((plots.track, "track.png"), (plots.estimates, "estimates.png")):
        with whole(folder / name) as partial:
            draw(log.vehicle(), partial)
    sonar(log, folder)


def sonar(log: Log, folder: Path) -> None:
    """Draws sonar.png and feature_map.png and writes feature_map.nc, if a lone vehicle kept frames of a sonar."""
    from auvsim.analysis import sonar_map, sonar_path, sonar_plots

    vehicle = log.vehicle()
    path = sonar_path.sonar_path(vehicle)
    if path is None:
        return
    with whole(folder / SONAR) as partial:
        sonar_plots.navigation(vehicle, path, partial)
    with whole(folder / MAP) as partial:
        sonar_map.sonar_map(vehicle, path, partial)
    sonar_map.save_map(vehicle, path, folder / MAP_DATA)


def video_name(log: Log) -> str:
    """What the video of a log is called."""
    return VIDEOS[0] if len(log.vehicles) == 1 and log.vehicle().mission == "docking" else VIDEOS[1]


def video(log: Log, folder: Path, *, speed: float | None = None, cameras: Sequence[str] = ()) -> None:
    """Draws the video, with a progress bar.

    Raises:
        DrawingError: Without OpenGL.
    """
    from auvsim import video
    from auvsim.cli.report import VideoProgress

    with VideoProgress() as progress, whole(folder / video_name(log)) as partial:
        video.render(log, partial, speed=speed, cameras=cameras, progress=progress)


def still(log: Log, folder: Path, *, path: Path, time: float | None = None, cameras: Sequence[str] = ()) -> None:
    """Draws one picture, wherever it is to be.

    Raises:
        InputError: It is no PNG.
        DrawingError: Without OpenGL.
    """
    if path.suffix.lower() != ".png":
        raise InputError(f"command line: --still {path}: the picture is a PNG; give a name that ends in .png")
    from auvsim import video

    video.still(log, path, time, cameras=cameras)


def summary(log: Log, folder: Path) -> dict[str, Any]:
    """Writes summary.json and returns what it holds."""
    from auvsim.analysis.summary import summarise_all

    values = summarise_all(log)
    with whole(folder / "summary.json") as partial:
        partial.write_text(json.dumps(values, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return values


def show_summary(log: Log, folder: Path) -> None:
    """Writes summary.json and prints it as a table."""
    from auvsim.cli import report
    from auvsim.missions.manoeuvres import metrics as manoeuvre_metrics

    values = summary(log, folder)
    if is_manoeuvre(log):
        report.manoeuvres(manoeuvre_metrics.figures(log.vehicle()))
    else:
        report.show(values)


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
