"""Estimators that end a trial in other ways than docking."""

from auvsim.navigation import navigator as navigation


class Raising:
    """Raises an error after some time."""

    def __init__(self, inner: navigation.Navigator) -> None:
        self._inner = inner

    def update(self, time, readings, commands):
        """Until 5 s the estimate of another."""
        if time > 5.0:
            raise FloatingPointError(f"lost at {time:g} s by {object()}")
        return self._inner.update(time, readings, commands)

    def reset(self) -> None:
        """As the other."""
        self._inner.reset()


def raising(parameters, scenario) -> Raising:
    """Makes one."""
    return Raising(navigation.augmented_ekf(parameters, scenario))
