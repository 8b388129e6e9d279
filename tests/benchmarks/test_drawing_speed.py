"""Pictures a second of software drawing at 640 x 480; run with --benchmark-enable to see them."""

from collections.abc import Iterator

import pytest

from auvsim.simulation import run, sampling, scenario
from auvsim.video.playback import Playback
from auvsim.video.stage import Stage
from auvsim.video.storyboard import Frame


@pytest.fixture(scope="module")
def playback() -> Playback:
    plan = scenario.parse(sampling.draw(sampling.merge(sampling.default_plan(), {"duration": 60.0}), 1))
    return Playback(run.run(plan, seed=1))


@pytest.fixture(params=["follow", "overview", "dock", "three views"])
def stage(request: pytest.FixtureRequest, playback: Playback) -> Iterator[Stage]:
    names = () if request.param == "three views" else (request.param,)
    with Stage(playback, 640, 480, names) as stage:
        yield stage


def test_drawing_speed(benchmark, stage: Stage, playback: Playback) -> None:
    """One picture, text and all, not yet encoded."""
    frame = Frame(time=playback.end, speed=1.0, near=False, banner="a line of text")
    picture = benchmark(stage.picture, frame, 0.04)
    assert picture.shape == (480, 640, 3)
