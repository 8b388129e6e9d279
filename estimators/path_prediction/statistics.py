"""Mean and variance of samples of which newer ones count more, by recursion (Yao et al. 2011, eqs 6 to 10)."""

from estimators.core.errors import ParameterError


class FadingStatistics:
    """The mean and variance of eqs 8 and 9, weights d_n b^(n-i), by the recursion of eq. 10.

    Args:
        forgetting: b, within 0 and 1.
        floor: What the variance is not less than while there are few samples.
        few: Samples up to which there are few.

    Raises:
        ParameterError: b does not lie within 0 and 1.
    """

    def __init__(self, forgetting: float = 0.95, floor: float = 0.0, few: int = 5) -> None:
        if not 0.0 < forgetting < 1.0:
            raise ParameterError(f"forgetting factor {forgetting} must lie within 0 and 1")
        self._b, self._floor, self._few = forgetting, floor, few
        self.count, self.mean, self._variance = 0, 0.0, 0.0

    @property
    def variance(self) -> float:
        """P_n of eq. 9, or the floor."""
        return max(self._variance, self._floor) if self.count < self._few else self._variance

    def update(self, sample: float) -> None:
        """Takes a sample."""
        self.count += 1
        d = (1.0 - self._b) / (1.0 - self._b**self.count)
        change = sample - self.mean
        self._variance = (1.0 - d) * (self._variance + d * change**2)
        self.mean += d * change
