"""What the study of paper 3 leaves: tables as CSV, and pictures."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from auvsim.reproduce.paper1.products import write_files
from auvsim.reproduce.paper3 import figures
from auvsim.reproduce.paper3.acceptance import verdicts
from auvsim.reproduce.paper3.claims import claims
from auvsim.reproduce.paper3.methods import METHODS
from auvsim.reproduce.paper3.study import POOLED, ROWS, Study, ratio, root_mean_square

TABLE1 = {"straight": (184.50, 182.66), "curve": (36.55, 63.45)}  # [m], predicted and own
TABLE2 = {"dr": 984.78, "ekf": 690.63, "dekf": 84.36, "iiru": 24.43}  # [m]


def write(study: Study, folder: Path) -> list[Path]:
    """Writes study.csv, acceptance.csv, claims.csv, table1.csv, table2.csv and the pictures.

    Raises:
        InputError: If one of them cannot be written.
    """
    tables = {
        "study.csv": study_rows(study),
        "acceptance.csv": acceptance_rows(study),
        "claims.csv": [("claim", "measured", "holds"), *claims(study)],
        "table1.csv": table1_rows(study),
        "table2.csv": table2_rows(study),
    }
    return write_files(folder, tables, figures.draw(study))


def study_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of study.csv: one for each row and method."""
    yield (
        "row", "title", "method", "runs", "rms_m", "rms_over_oracle", "low", "high", "bound_m", "nees", "nees_at_end",
        "signed_mean_m", "relative_rms_m", "cpu_ms", "memory_byte",
    )  # fmt: skip
    for name, results in study.results.items():
        for key, runs in results.items():
            compared = ratio(runs, results["oracle"]) if "oracle" in results else (math.nan,) * 3
            bound = study.bounds[name][-1] if name in study.bounds else math.nan
            relative = root_mean_square(runs.relative) if np.isfinite(runs.relative).all() else math.nan
            yield (
                name, ROWS[name].title, METHODS[key].title, len(runs.final), runs.rms, *compared, bound,
                float(runs.nees.mean()), float(runs.final_nees.mean()), runs.signed_mean, relative,
                1e3 * float(np.median(runs.cpu)), float(np.median(runs.memory)),
            )  # fmt: skip


def acceptance_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of acceptance.csv: one for each thing to reach."""
    yield "row", "quantity", "measured", "deviation", "low", "high", "met", "reason"
    for v in verdicts(study):
        yield v.row, v.quantity, v.measured, v.deviation, v.low, v.high, v.met, v.reason


def table1_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of table 1: the leader's error at the end, as predicted by IIRU and its own."""
    yield "scene", "quantity", "paper_m", "signed_mean_m", "rms_m"
    for scene, (predicted, own) in TABLE1.items():
        if (results := study.results.get(f"paper_sensor_{scene}")) is not None:
            for quantity, paper, errors in (
                ("predicted", predicted, results["iiru"].leader),
                ("own", own, results["iiru"].own),
            ):
                signed = float(np.hypot(*errors.mean(axis=0)))
                yield scene, quantity, paper, signed, root_mean_square(errors)


def table2_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of table 2: signed means as the paper's of sets of 50 runs, and rms, of weave and straight."""
    yield "method", "paper_m", "weave_signed_mean_m", "lowest_set_m", "highest_set_m", "weave_rms_m", "straight_rms_m"
    if POOLED not in study.results:
        return
    straight = study.results.get("paper_sensor_straight", {})
    for key, paper in TABLE2.items():
        runs = study.results[POOLED][key]
        sets = [
            float(np.hypot(*part.mean(axis=0))) for part in np.array_split(runs.final, max(1, len(runs.final) // 50))
        ]
        other = straight[key].rms if key in straight else math.nan
        yield METHODS[key].title, paper, float(np.median(sets)), min(sets), max(sets), runs.rms, other
