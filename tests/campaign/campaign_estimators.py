"""Estimators that end a trial in other ways than docking."""

from dataclasses import replace

from auvsim.navigation import registry
from auvsim.navigation.navigator import Navigator
from auvsim.navigation.settings import AugmentedSettings


class Raising:
    """Raises an error after some time."""

    def __init__(self, inner: Navigator) -> None:
        self._inner = inner
        self.states = inner.states

    def update(self, time, readings, messages, commands):
        """Until 5 s the estimate of another."""
        if time > 5.0:
            raise FloatingPointError(f"lost at {time:g} s by {object()}")
        return self._inner.update(time, readings, messages, commands)

    def reset(self) -> None:
        """As the other."""
        self._inner.reset()


def raising(setup) -> Raising:
    """Makes one."""
    return Raising(registry.build(replace(setup, settings=AugmentedSettings())))
