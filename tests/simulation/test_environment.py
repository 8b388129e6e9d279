"""The dm_env face: random actions keep the contract, and its physics is the trial's."""

import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.simulation import environment, scenario


@pytest.fixture(scope="module")
def plan() -> scenario.Scenario:
    start = {"range": 12.0, "depth": 20.0, "speed": 1.0}
    return scenario.parse({"duration": 20.0, "vehicle": {"start": start}, "current": {"kind": "uniform", "speed": 0.0}})


def test_random_actions_keep_the_contract(plan):
    env = environment.load(plan, seed=3)
    spec, generator = env.action_spec(), np.random.default_rng(0)
    step = env.reset()
    assert step.first()
    for name, value in step.observation.items():
        env.observation_spec()[name].validate(np.asarray(value))
    steps = 0
    while not step.last():
        step = env.step(generator.uniform(spec.minimum, spec.maximum, spec.shape))
        assert np.isfinite(step.reward)
        assert all(np.all(np.isfinite(value)) for value in step.observation.values())
        steps += 1
    # 20 s at 10 Hz, unless it stumbled into the dock before.
    assert steps == 200 or step.discount == 0.0


def test_specs_are_known_before_the_first_reset(plan):
    """Wrappers of dm_env ask for them at once."""
    env = environment.load(plan)
    spec = env.observation_spec()
    for name, value in env.reset().observation.items():
        spec[name].validate(np.asarray(value))


def test_an_action_that_is_no_number_is_refused(plan):
    env = environment.load(plan)
    env.reset()
    with pytest.raises(InputError, match="three finite fractions"):
        env.step((0.0, np.nan, 0.1))


def test_several_vehicles_or_no_dock_are_refused():
    two = {"a": {"start": {"north": 0.0, "east": 0.0}}, "b": {"start": {"north": 50.0, "east": 0.0}}}
    track = {"mission": {"kind": "track"}}
    with pytest.raises(InputError, match="2 vehicles"):
        environment.load(scenario.parse({"vehicles": {name: values | track for name, values in two.items()}}))
    with pytest.raises(InputError, match="no dock"):
        environment.load(scenario.parse({"vehicles": {"a": two["a"] | track}}))


def test_an_episode_is_the_same_again(plan):
    def episode() -> np.ndarray:
        env, generator = environment.load(plan, seed=3), np.random.default_rng(1)
        env.reset()
        return np.array([env.step(generator.uniform(-1, 1, 3)).observation["nose"] for _ in range(40)])

    np.testing.assert_array_equal(episode(), episode())


def test_straight_ahead_docks_and_is_rewarded(plan):
    env = environment.load(plan)
    step = env.reset()
    shaft = float(step.observation["shaft_speed"][0]) / 159.7
    total = 0.0
    while not step.last():
        step = env.step((0.0, 0.0, shaft))
        total += step.reward
    assert step.discount == 0.0
    # 12 m less the nose, 0.8 m, and 1.29 m to the latched place; the latch closes up to 0.15 m before it.
    assert total == pytest.approx(100.0 + 12.0 - 0.8 + 1.29, abs=0.2)
