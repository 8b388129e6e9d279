"""Parameters of the planar model from records of manoeuvres."""

from auvsim.base.neighbours import check_estimators

check_estimators()
