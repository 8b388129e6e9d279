"""The paper's formations and its printed results (Li et al. 2023, tables 1 to 3)."""

from collections.abc import Mapping

import numpy as np

from auvsim.base.frames import Array

# Leaders as printed, x to the east and y to the north [m]; the follower stands at the origin, all head north.
_NEAR = {
    1: ((0.0, 1000.0), (-866.0, -500.0), (866.0, -500.0)),
    2: ((0.0, 1000.0), (-866.0, 500.0), (866.0, 500.0)),
    3: ((-1000.0, 0.0), (1000.0, 0.0), (2000.0, 0.0)),
    4: ((0.0, -1000.0), (0.0, 1000.0), (0.0, 2000.0)),
    5: ((707.0, 707.0), (707.0, -707.0), (-800.0, -600.0)),
}
FORMATIONS: Mapping[int, Array] = {
    number + shift: np.array(places)[:, ::-1] / scale  # north, east
    for shift, scale in ((0, 1.0), (5, 10.0))
    for number, places in _NEAR.items()
}
GOOD = (1, 2, 5, 6, 7, 10)  # optimal and sub-optimal; the others stand on a line with the follower
WORST = (3, 4, 8, 9)
SPEEDS = (1.0, 10.0)  # [m/s]
VARIANCES = (2.0, 4.0, 6.0)  # of the ranges, at 1 m/s [m^2]
DURATION = 1000.0  # [s]

TABLE2 = {  # A_RMS at 1 and 10 m/s [m]
    1: (1.6243, 1.7850), 2: (1.6291, 1.7877), 3: (12.7904, 31.1584), 4: (5.6258, 12.8481), 5: (1.7008, 1.8816),
    6: (1.6250, 1.7887), 7: (1.6301, 1.7898), 8: (6.7804, 15.1127), 9: (3.2508, 5.0707), 10: (1.7125, 1.8820),
}  # fmt: skip
TABLE3 = {  # A_RMS by variance of the ranges [m]
    2.0: (1.2239, 1.2264, 11.6426, 5.1084, 1.2839, 1.2243, 1.2288, 6.1826, 2.9780, 1.2846),
    4.0: (1.6243, 1.6291, 12.7904, 5.6258, 1.7008, 1.6250, 1.6301, 6.7804, 3.2508, 1.7125),
    6.0: (1.9072, 1.8993, 13.1092, 5.7173, 1.9960, 1.9097, 1.9042, 7.1505, 3.7327, 2.0008),
}
