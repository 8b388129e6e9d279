"""Identification from records of manoeuvres: the planar model's parameters, and the structure of a motion model."""

from auvsim.base.neighbours import check_estimators

check_estimators()
