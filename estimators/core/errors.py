"""Errors of the estimators: one root; a text says what was wrong, where, and what would be right."""


class EstimatorError(Exception):
    """Root of all errors that the estimators raise on purpose."""


class ParameterError(EstimatorError, ValueError):
    """A parameter, input or time that a filter cannot use."""


class NotFiniteError(EstimatorError, ArithmeticError):
    """A prediction or correction gave infinite values or no number at all; the belief before it is unchanged."""


class NotPositiveDefiniteError(EstimatorError, ArithmeticError):
    """A covariance that must be positive definite is not."""
