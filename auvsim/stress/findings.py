"""Findings: trials that a search came upon, as scenarios that run again bit for bit."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from auvsim.base import yaml_text
from auvsim.campaign import folder
from auvsim.stress.plan import Point
from auvsim.stress.search import Searches

MOST = 10  # of each kind


@dataclass(frozen=True, kw_only=True, slots=True)
class Finding:
    """A trial worth looking at."""

    name: str  # of its file
    what: str
    point: Point

    def command(self, path: Path, seed: int) -> str:
        """What runs it again, with a video.

        Args:
            path: Folder of the stress test.
            seed: Of the plan.
        """
        verb = "run" if "vehicles" in self.point.values else "dock"
        there = path / "replays" / self.name
        return f"auvsim {verb} {_file(path, self.name)} --seed {seed} --trial {self.point.trial} --out {there}"


def found(searches: Searches, metric: str = "miss_distance") -> list[Finding]:
    """The findings of all searches, of each kind the worst first."""
    return [
        Finding(name=f"{kind}_{number:02d}", what=what, point=point)
        for kind, points in (("edge", _edge(searches)), ("rare", _rare(searches)), ("worst", _worst(searches)))
        for number, (what, point) in enumerate(points[:MOST], 1)
    ]


def write(findings: list[Finding], path: Path, seed: int) -> None:
    """Writes each as a scenario; those of before go.

    Raises:
        InputError: If there is no room, or the folder cannot be written to.
    """
    for old in (path / "findings").glob("*.yaml"):
        old.unlink(missing_ok=True)
    for finding in findings:
        head = f"# {finding.what}\n# {finding.command(path, seed)}\n"
        folder.write(_file(path, finding.name), (head + yaml_text.dump(dict(finding.point.values))).encode())


def _file(path: Path, name: str) -> Path:
    return path / "findings" / f"{name}.yaml"


def _edge(searches: Searches) -> list[tuple[str, Point]]:
    """Failures at the mildest levels, of which each trial counts once."""
    failed: dict[tuple[tuple[str, ...], int], tuple[float, str, Point]] = {}
    for ladder in searches.ladders:
        for rung in ladder.rungs:
            at = ", ".join(f"{name} {value:.4g}" for name, value in ladder.values(rung.level).items())
            for outcome in rung.outcomes:
                key = (ladder.names, outcome.point.trial)
                if not outcome.success and (key not in failed or rung.level < failed[key][0]):
                    why = next(
                        (str(row.get("failure_text")) for row in outcome.vehicles if row.get("failure_text")), ""
                    )
                    text = f"trial {outcome.point.trial} fails at {at}" + (f": {why}" if why else "")
                    failed[key] = (rung.level, text, outcome.point)
    return [(text, point) for _, text, point in sorted(failed.values(), key=lambda entry: entry[:2])]


def _rare(searches: Searches) -> list[tuple[str, Point]]:
    if searches.rare is None:
        return []
    samples = sorted(searches.rare.samples, key=lambda sample: -sample.score)
    metric = searches.rare.settings.metric
    return [
        (f"{metric} {_number(s.score)}, {len(s.walk)} steps from trial {s.trial}", s.outcome.point) for s in samples
    ]


def _worst(searches: Searches) -> list[tuple[str, Point]]:
    if searches.worst is None or not searches.worst.iterations:
        return []
    best, metric = searches.worst.best, searches.worst.settings.metric
    text = "worst current, trial {}: {} {}"
    return [(text.format(o.point.trial, metric, _number(o.score(metric))), o.point) for o in best.outcomes]


def _number(score: float) -> str:
    return f"{score:.4g}" if math.isfinite(score) else "none"


def commands(findings: list[Finding], path: Path, seed: int) -> Iterator[tuple[str, str, str]]:
    """Name, what it is and command of each."""
    for finding in findings:
        yield finding.name, finding.what, finding.command(path, seed)
