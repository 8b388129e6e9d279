"""Texts that say a time: ISO 8601, day first, or a clock alone."""

import re
from collections.abc import Callable, Sequence
from datetime import UTC, datetime

import numpy as np

from estimators.core.types import Array

FORMS = "seconds, 2026-11-27T10:00:00.5Z (ISO 8601), 27.11.2026 10:00:00.5 (day first), or 10:00:00.5"
DAY = 86400.0  # [s]
_DAY_FIRST = re.compile(r"(\d{1,2})[./-](\d{1,2})[./-](\d{4})[ T]+(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?)")
_CLOCK = re.compile(r"(\d{1,3}):(\d{2}):(\d{2}(?:[.,]\d+)?)")


def seconds(texts: Sequence[str]) -> Array | None:
    """Times [s] of texts (n,), NaN where one is none; None where fewer than half of them are times.

    A text without a zone is in UTC. A clock alone counts from midnight, and goes on over the next one.
    """
    forms: tuple[Callable[[str], float], ...] = (_iso, _day_first, _clock)
    for form in forms:
        found = np.array([form(text.strip()) for text in texts])
        if np.isfinite(found).sum() > 0.5 * len(texts):
            return _over_midnight(found) if form is _clock else found
    return None


def _iso(text: str) -> float:
    if not re.match(r"\d{4}-\d\d-\d\d[T ]", text):
        return np.nan
    try:
        moment = datetime.fromisoformat(text.replace(",", "."))
    except ValueError:
        return np.nan
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _day_first(text: str) -> float:
    found = _DAY_FIRST.fullmatch(text)
    if found is None:
        return np.nan
    day, month, year, hour, minute = map(int, found.groups()[:5])
    try:
        moment = datetime(year, month, day, hour, minute, tzinfo=UTC)
    except ValueError:
        return np.nan
    return moment.timestamp() + float(found[6].replace(",", "."))


def _clock(text: str) -> float:
    found = _CLOCK.fullmatch(text)
    if found is None or int(found[2]) > 59:
        return np.nan
    return 3600.0 * int(found[1]) + 60.0 * int(found[2]) + float(found[3].replace(",", "."))


def _over_midnight(times: Array) -> Array:
    """The same with a day more after each step back by more than half a day."""
    there = np.flatnonzero(np.isfinite(times))
    days = np.cumsum(np.concatenate([[0.0], np.diff(times[there]) < -0.5 * DAY]))
    result = times.copy()
    result[there] += DAY * days
    return result
