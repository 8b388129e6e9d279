"""Navigation: from readings to an estimate, by any estimator behind one contract."""

from auvsim.base.neighbours import check_estimators

check_estimators()
