"""Enumerations and bit strings of ETSI's common data dictionary (TS 102 894-2) that a CAM holds."""

from __future__ import annotations

from enum import IntEnum, IntFlag


class StationType(IntEnum):
    """`stationType` of ETSI TS 102 894-2."""

    UNKNOWN = 0
    PEDESTRIAN = 1
    CYCLIST = 2
    MOPED = 3
    MOTORCYCLE = 4
    PASSENGER_CAR = 5
    BUS = 6
    LIGHT_TRUCK = 7
    HEAVY_TRUCK = 8
    TRAILER = 9
    SPECIAL_VEHICLE = 10
    TRAM = 11
    ROAD_SIDE_UNIT = 15


class DriveDirection(IntEnum):
    """`driveDirection` of ETSI TS 102 894-2."""

    FORWARD = 0
    BACKWARD = 1
    UNAVAILABLE = 2


class CurvatureCalculationMode(IntEnum):
    """`curvatureCalculationMode` of ETSI TS 102 894-2."""

    YAW_RATE_USED = 0
    YAW_RATE_NOT_USED = 1
    UNAVAILABLE = 2


class TrailerPresence(IntEnum):
    """The DE vehicleLengthConfidenceIndication."""

    NONE = 0
    KNOWN_LENGTH = 1
    UNKNOWN_LENGTH = 2
    UNKNOWN_PRESENCE = 3
    UNAVAILABLE = 4


class VehicleRole(IntEnum):
    """`vehicleRole` of ETSI TS 102 894-2."""

    DEFAULT = 0
    PUBLIC_TRANSPORT = 1
    SPECIAL_TRANSPORT = 2
    DANGEROUS_GOODS = 3
    ROAD_WORK = 4
    RESCUE = 5
    EMERGENCY = 6
    SAFETY_CAR = 7
    AGRICULTURE = 8
    COMMERCIAL = 9
    MILITARY = 10
    ROAD_OPERATOR = 11
    TAXI = 12
    RESERVED_1 = 13
    RESERVED_2 = 14
    RESERVED_3 = 15


class ExteriorLights(IntFlag):
    """Eight bits; ASN.1 counts them from the most significant one."""

    NONE = 0
    LOW_BEAM = 1 << 7
    HIGH_BEAM = 1 << 6
    LEFT_TURN_SIGNAL = 1 << 5
    RIGHT_TURN_SIGNAL = 1 << 4
    DAYTIME_RUNNING = 1 << 3
    REVERSE = 1 << 2
    FOG = 1 << 1
    PARKING = 1 << 0


class AccelerationControl(IntFlag):
    """Seven bits."""

    NONE = 0
    BRAKE_PEDAL = 1 << 6
    GAS_PEDAL = 1 << 5
    EMERGENCY_BRAKE = 1 << 4
    COLLISION_WARNING = 1 << 3
    ACC = 1 << 2
    CRUISE_CONTROL = 1 << 1
    SPEED_LIMITER = 1 << 0


class SensorType(IntEnum):
    """`sensorType` of ETSI TS 102 894-2 v2.1.1."""

    UNDEFINED = 0
    RADAR = 1
    LIDAR = 2
    MONO_VIDEO = 3
    STEREO_VISION = 4
    NIGHT_VISION = 5
    ULTRASONIC = 6
    PMD = 7
    INDUCTION_LOOP = 8
    SPHERICAL_CAMERA = 9
    UWB = 10
    ACOUSTIC = 11
    LOCAL_AGGREGATION = 12
    ITS_AGGREGATION = 13
