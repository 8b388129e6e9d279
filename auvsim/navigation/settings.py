"""Settings of the estimators by kind: the noise and the model that each assumes."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from auvsim.base.settings import OwnPart, Settings, tag_by_kind


class _Assumed(Settings):
    """The planar model that an estimator assumes."""

    model: str = Field(
        default="condense",
        description="planar model: condense (fitted to MuJoCo's vehicle), a name in models/<vehicle>/planar/, a .yaml",
    )
    model_speed: float = Field(
        default=1.0, ge=0.05, le=20.0, description="speed through the water at which the planar model is fitted [m/s]"
    )


class PaperSettings(_Assumed):
    """Paper 1's filter and its halves, with the noises that the paper recommends."""

    kind: Literal["paper", "current_only", "delay_only", "regular_ekf"] = "paper"
    compass_deg: float = Field(default=1.0, gt=0, description="assumed compass noise per reading, sd [deg]")
    dock_heading_deg: float = Field(default=0.3, ge=0, description="assumed error of the dock's compass, sd [deg]")


class AugmentedSettings(_Assumed):
    """Kalman filters with the current in their state."""

    kind: Literal["augmented_ekf", "ukf"] = Field(default="augmented_ekf")
    compass_deg: float = Field(default=1.0, gt=0, description="assumed compass noise per reading, sd [deg]")
    position_noise: float = Field(default=4e-5, ge=0, description="process noise of position [m2/s]")
    heading_noise: float = Field(default=1e-6, ge=0, description="process noise of heading [rad2/s]")
    velocity_noise: float = Field(default=1e-4, ge=0, description="process noise of surge and sway [m2/s3]")
    yaw_rate_noise: float = Field(default=1e-5, ge=0, description="process noise of yaw rate [rad2/s3]")
    current_noise: float = Field(
        default=3e-6, ge=0, description="random walk of the current [m2/s3]; 3e-3 in turns without imm"
    )
    dock_heading_deg: float = Field(default=0.3, ge=0, description="assumed error of the dock's compass, sd [deg]")
    dock_heading_state: bool = Field(
        default=True, description="whether that error is a constant, which is estimated, or white noise of each fix"
    )
    use: tuple[Literal["gyro", "dvl", "range", "light"], ...] = Field(
        default=("gyro", "dvl", "range", "light"),
        description="sensors it uses, where on board, besides compass and USBL",
    )


class InteractingSettings(AugmentedSettings):
    """Interacting filters, for currents that may turn."""

    kind: Literal["imm", "imm_biased"] = "imm"  # pyright: ignore[reportIncompatibleVariableOverride]
    steady_noise: float = Field(
        default=1e-6, ge=0, description="random walk of the current in the steady modes of the imm [m2/s3]"
    )
    turning_noise: float = Field(
        default=0.02, ge=0, description="random walk of the current while it turns, in the imm [m2/s3]"
    )
    turn_interval: float = Field(default=300.0, gt=0, description="mean time between turns that the imm assumes [s]")
    compass_bias_deg: float = Field(
        default=0.5, ge=0, description="assumed compass bias, which the imm estimates, sd [deg]"
    )


class RobustSettings(InteractingSettings):
    """Interacting filters for steady, gusty and turning currents, errors of the compass, outliers and false echoes."""

    kind: Literal["robust"] = Field(  # pyright: ignore[reportIncompatibleVariableOverride]
        default="robust",
        description="robust, imm, imm_biased, augmented_ekf, ukf, dead_reckoning, paper, delay_only, or module:factory",
    )
    compass_bias_deg: float = Field(default=2.0, ge=0, description="assumed compass bias, which it estimates, sd [deg]")
    gust_noise: float = Field(default=2e-3, ge=0, description="random walk of the current in gusty water [m2/s3]")
    turn_interval: float = Field(default=3000.0, gt=0, description="mean time between turns that it assumes [s]")
    gust_interval: float = Field(
        default=3000.0, gt=0, description="mean time in steady water before it becomes gusty [s]"
    )
    outlier_probability: float = Field(
        default=0.05, gt=0, lt=1, description="assumed share of fixes that are wrong [-]"
    )
    usbl_noise: float = Field(default=1.0, gt=0, description="factor on the assumed noise of fixes [-]")
    dock_clock: float = Field(
        default=0.0, ge=0, description="assumed offset of the dock's clock, which it estimates, sd; 0: none [s]"
    )
    keep: float = Field(default=40.0, gt=0, description="age up to which fixes are used [s]")


class ReckoningSettings(_Assumed):
    """Dead reckoning by DVL, gyro and compass, with fixes and ranges; it needs no model of the vehicle."""

    kind: Literal["dead_reckoning"] = "dead_reckoning"
    position_noise: float = Field(
        default=0.0, ge=0, description="process noise of position, for errors of scale and mounting of a DVL [m2/s]"
    )
    acceleration: float = Field(default=0.01, ge=0, description="process noise of surge and sway [m2/s3]")
    yaw_acceleration: float = Field(default=0.01, ge=0, description="process noise of yaw rate [rad2/s3]")
    compass_error_deg: float = Field(default=1.0, gt=0, description="constant error of the compass it estimates [deg]")
    dock_heading_deg: float = Field(default=0.3, ge=0, description="error of the dock's compass it assumes [deg]")


class SonarSettings(ReckoningSettings):
    """Dead reckoning beside an imaging sonar, whose frames are matched with earlier ones."""

    kind: Literal["sonar"] = "sonar"  # pyright: ignore[reportIncompatibleVariableOverride]
    match: bool = Field(default=True, description="whether frames are matched; without, it is dead reckoning")
    closures: bool = Field(default=True, description="whether loops are closed between lanes")
    stride: int = Field(
        default=2, ge=1, le=1000, description="frames from one that is matched to the next; a DVL knows the rest better"
    )
    keyframes: int = Field(
        default=2, ge=1, le=1000, description="matched frames from one that is kept for closures to the next"
    )
    nearer: float = Field(
        default=0.4,
        ge=0,
        le=5,
        description="by which echoes come from before what they are of: near sides of rocks and slopes [m]",
    )
    nearer_error: float = Field(default=0.1, ge=0, le=5, description="standard deviation of that, learnt [m]")
    keep: float = Field(default=10.0, gt=0, description="age up to which measurements are used [s]")


class FollowerSettings(_Assumed):
    """A filter of a follower that hears where others are, and ranges to them by their packets."""

    kind: Literal["range_ekf"] = "range_ekf"
    north: float | None = Field(default=None, description="assumed start; none: the planned one [m]")
    east: float | None = Field(default=None, description="assumed start; none: the planned one [m]")
    position_noise: float = Field(
        default=1e-3, ge=0, description="process noise of position, for errors of scale and mounting of a DVL [m2/s]"
    )
    position: float = Field(default=3.0, gt=0, description="error of the assumed start along each axis, sd [m]")
    current: float = Field(default=0.5, gt=0, description="unknown current along each axis, sd [m/s]")
    current_noise: float = Field(default=1e-7, ge=0, description="random walk of the current [m2/s3]")
    acceleration: float = Field(default=0.01, ge=0, description="process noise of surge and sway [m2/s3]")
    yaw_acceleration: float = Field(default=0.01, ge=0, description="process noise of yaw rate [rad2/s3]")
    range_noise: float = Field(default=0.5, gt=0, description="error of a range besides arrival times and packet [m]")


class MotionRadiusSettings(_Assumed):
    """The bank of filters of a follower in an unknown current (paper 2); errors with sd 0 are taken for none."""

    kind: Literal["motion_radius"] = "motion_radius"
    north: float | None = Field(default=None, description="assumed start; none: the planned one [m]")
    east: float | None = Field(default=None, description="assumed start; none: the planned one [m]")
    position: float = Field(default=3.0, gt=0, description="error of the assumed start along each axis, sd [m]")
    current: float = Field(default=1.0, gt=0, description="unknown current along each axis, sd [m/s]")
    current_noise: float = Field(default=1e-8, ge=0, description="random walk of the current [m2/s3]")
    position_noise: float = Field(default=1e-3, ge=0, description="process noise of position besides odometry [m2/s]")
    range_noise: float = Field(default=0.5, gt=0, description="error of a range besides arrival times and packet [m]")
    clock_offset: float = Field(default=0.0, ge=0, description="difference of the two clocks, sd [s]")
    clock_drift_ppm: float = Field(default=0.0, ge=0, description="difference of the two clocks' drifts, sd [ppm]")
    sound_speed_error: float = Field(default=0.0, ge=0, description="error of the assumed sound speed, sd [-]")
    memory: float = Field(
        default=30.0, ge=0, description="time constant of the errors of what others tell of their places; 0: white [s]"
    )


class PathPredictionSettings(_Assumed):
    """The filter of a follower that hears pulses and late packets (paper 3): bottom track, gyro, no current."""

    kind: Literal["path_prediction"] = "path_prediction"
    north: float | None = Field(default=None, description="assumed start; none: the planned one [m]")
    east: float | None = Field(default=None, description="assumed start; none: the planned one [m]")
    position: float = Field(default=3.0, gt=0, description="error of the assumed start along each axis, sd [m]")
    heading: float = Field(default=0.5, gt=0, description="error of the first heading besides the compass' bias [deg]")
    period: float = Field(default=8.0, gt=0, description="period of the leader's pulses [s]")
    delay: float = Field(default=15.0, ge=0, description="longest time from a pulse to its packet [s]")
    position_noise: float = Field(
        default=1e-3, ge=0, description="process noise along the way besides the DVL's [m2/s]"
    )
    heading_noise: float = Field(default=1e-7, ge=0, description="process noise of heading besides the gyro's [rad2/s]")
    range_noise: float = Field(default=0.5, gt=0, description="error of a range besides arrival times [m]")
    leader_speed_noise: float = Field(default=1e-3, ge=0, description="noise of the leader's way [m2/s]")
    leader_yaw_noise: float = Field(default=1e-6, ge=0, description="noise of the leader's heading [rad2/s]")


class OwnEstimator(OwnPart, _Assumed):
    """An estimator of the user's own, made by a factory."""


EstimatorSettings = Annotated[
    Annotated[RobustSettings, Tag("RobustSettings")]
    | Annotated[AugmentedSettings, Tag("AugmentedSettings")]
    | Annotated[InteractingSettings, Tag("InteractingSettings")]
    | Annotated[PaperSettings, Tag("PaperSettings")]
    | Annotated[ReckoningSettings, Tag("ReckoningSettings")]
    | Annotated[SonarSettings, Tag("SonarSettings")]
    | Annotated[FollowerSettings, Tag("FollowerSettings")]
    | Annotated[MotionRadiusSettings, Tag("MotionRadiusSettings")]
    | Annotated[PathPredictionSettings, Tag("PathPredictionSettings")]
    | Annotated[OwnEstimator, Tag("OwnEstimator")],
    Discriminator(
        tag_by_kind(
            RobustSettings,
            AugmentedSettings,
            InteractingSettings,
            PaperSettings,
            ReckoningSettings,
            SonarSettings,
            FollowerSettings,
            MotionRadiusSettings,
            PathPredictionSettings,
            OwnEstimator,
        )
    ),
]
