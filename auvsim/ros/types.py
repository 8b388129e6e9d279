"""Message types: the standard ones of ROS 2, and those of instruments that ROS does not have.

DVL: `marine_acoustic_msgs/msg/Dvl` (velocities forward, starboard, down) and `dvl_msgs/msg/DVL` of the Water Linked
driver. USBL: ROS 2 has none that is agreed upon; `farol_msgs/msg/MUSBLFix` has the fields of the USBLFix messages of
LABUST and DSOR under ROS 1.
"""

from functools import lru_cache
from typing import Any

from auvsim.base.errors import InputError

DVL, WATER_LINKED, USBL = "marine_acoustic_msgs/msg/Dvl", "dvl_msgs/msg/DVL", "farol_msgs/msg/MUSBLFix"
UNKNOWN = 1e6  # variance of what is not estimated
_DEFINITIONS = {
    DVL: """
# bottom 1, water 2
uint8 DVL_MODE_BOTTOM=1
uint8 DVL_MODE_WATER=2
uint8 DVL_TYPE_PISTON=0
uint8 DVL_TYPE_PHASED_ARRAY=1
std_msgs/Header header
uint8 velocity_mode
uint8 dvl_type
geometry_msgs/Vector3 velocity
float64[9] velocity_covar
float64 altitude
float64 course_gnd
float64 speed_gnd
uint8 num_good_beams
float32 sound_speed
bool beam_ranges_valid
bool beam_velocities_valid
geometry_msgs/Vector3[4] beam_unit_vec
float64[4] range
float32[4] range_covar
float32[4] beam_quality
float32[4] beam_velocity
float32[4] beam_velocity_covar
""",
    "dvl_msgs/msg/DVLBeam": """
int64 id
float64 velocity
float64 distance
float64 rssi
float64 nsd
bool valid
""",
    WATER_LINKED: """
std_msgs/Header header
float64 time
geometry_msgs/Vector3 velocity
float64 fom
float64[] covariance
float64 altitude
dvl_msgs/DVLBeam[] beams
bool velocity_valid
int64 status
int64 time_of_validity
int64 time_of_transmission
string form
""",
    USBL: """
int32 RANGE_ONLY=0
int32 AZIMUTH_ONLY=1
int32 FULL_FIX=2
int32 CARTESIAN=3
std_msgs/Header header
int32 source_id
string source_name
string source_frame_id
int32 type
geometry_msgs/Point relative_position
float32 range
float32 bearing
float32 elevation
float32 sound_speed
float32 bearing_raw
float32 elevation_raw
float64 position_covariance
""",
}
NEEDED = "ROS messages need the packages rosbags and mcap: pip install 'auvsim[ros]'"


@lru_cache
def known() -> dict[str, Any]:
    """Definitions of all known message types, by name, as `rosbags` registers them.

    Raises:
        InputError: `rosbags` is not installed.
    """
    typesys = _typesys()
    found = dict(typesys.get_typestore(typesys.Stores.ROS2_HUMBLE).fielddefs)
    for name, text in _DEFINITIONS.items():
        found |= typesys.get_types_from_msg(text, name)
    return found


def store(own: dict[str, Any] | None = None) -> Any:
    """A store of message types: the known ones, and before them a file's own definitions.

    Raises:
        InputError: `rosbags` is not installed.
    """
    typesys = _typesys()
    found = typesys.get_typestore(typesys.Stores.EMPTY)
    found.register(known() | (own or {}))
    return found


def _typesys() -> Any:
    try:
        from rosbags import typesys
    except ImportError:
        raise InputError(NEEDED) from None
    return typesys
