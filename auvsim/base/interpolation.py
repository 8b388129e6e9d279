"""Cubic Hermite interpolation between two samples of a value and its slope; once continuously differentiable."""


def cubic_hermite(
    start: float, end: float, start_slope: float, end_slope: float, width: float, fraction: float
) -> tuple[float, float]:
    """Value and slope inside an interval whose ends' values and slopes are known.

    Args:
        start: Value at the start.
        end: Value at the end.
        start_slope: Slope at the start, per unit of `width`.
        end_slope: Slope at the end, per unit of `width`.
        width: Length of the interval, > 0.
        fraction: Where to evaluate, 0 at the start and 1 at the end.

    Returns:
        The value, and its slope per unit of `width`.
    """
    rise = end - start
    a, b = start_slope * width, end_slope * width
    cubic = a + b - 2.0 * rise
    square = 3.0 * rise - 2.0 * a - b
    value = start + fraction * (a + fraction * (square + fraction * cubic))
    slope = (a + fraction * (2.0 * square + fraction * 3.0 * cubic)) / width
    return value, slope
