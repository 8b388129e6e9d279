"""Ctrl-C during a run: the step is ended, the log is kept whole, whatever code it comes to."""

import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from auvsim.base.interruption import PATIENCE, HeldInterrupt
from auvsim.data import log
from auvsim.data.recorder import Recorder
from auvsim.missions.docking.guidance import Docking
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import run


@pytest.fixture(autouse=True)
def as_in_a_terminal() -> Iterator[None]:
    """Ctrl-C is heard, also where the tests run in the background of a script, which then ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def short(duration: float = 30.0) -> scenario.Scenario:
    """The default trial, cut."""
    return scenario.parse(sampling.draw(sampling.default_plan(), 1) | {"duration": duration})


def test_ctrl_c_within_a_step_ends_it_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pressed in the middle of a mission's update, which then still decides; the log on disk is whole."""
    update, ticks = Docking.update, []

    def pressed(self, now):
        ticks.append(now.time)
        if len(ticks) == 50:
            signal.raise_signal(signal.SIGINT)
            ticks.append(-1.0)  # what follows in this step is still done
        return update(self, now)

    monkeypatch.setattr(Docking, "update", pressed)
    before = signal.getsignal(signal.SIGINT)
    run(short(), seed=1, path=tmp_path / "trial.nc")
    assert ticks[-1] == -1.0
    found = log.read(tmp_path / "trial.nc")
    assert found.attributes["status"] == "interrupted"
    assert len(found.vehicle()["mission"]["time"]) == 50
    assert signal.getsignal(signal.SIGINT) is before
    assert [entry.name for entry in tmp_path.iterdir()] == ["trial.nc"]


def test_ctrl_c_while_the_log_is_finished_does_not_lose_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    finish = Recorder.finish

    def pressed(self, *arguments, **named):
        signal.raise_signal(signal.SIGINT)
        return finish(self, *arguments, **named)

    monkeypatch.setattr(Recorder, "finish", pressed)
    run(short(2.0), seed=1, path=tmp_path / "trial.nc")
    assert log.read(tmp_path / "trial.nc").attributes["status"] == "complete"


def test_the_third_press_does_not_wait() -> None:
    """For a step that hangs."""
    with HeldInterrupt() as held:
        for _ in range(PATIENCE - 1):
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            held.check()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_where_ctrl_c_is_ignored_or_in_a_thread_nothing_changes() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with HeldInterrupt() as held:
            signal.raise_signal(signal.SIGINT)
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        assert held.presses == 0
    finally:
        signal.signal(signal.SIGINT, before)
    found = []

    def elsewhere() -> None:
        with HeldInterrupt():
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert found == [before]
