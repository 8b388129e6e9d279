"""Navigation: from readings to an estimate, by any estimator behind one contract."""
