from __future__ import annotations

from one_attacker import genuine

from advpipe.pipeline.v2x.codec.codes import AccelerationControl

BRAKE, GAS = AccelerationControl.BRAKE_PEDAL, AccelerationControl.GAS_PEDAL


def accelerations(cams):
    return [cam.longitudinal_acceleration_mps2 for cam in cams]


def test_acceleration_is_multiplied(attacked_cams):
    """By 3: 1 is 3, -2 is -6, and of 8 a CAM can tell 16 at most."""
    messages = [
        genuine(ms, longitudinal_acceleration_mps2=value) for ms, value in ((0, 1.0), (100, -2.0), (200, 8.0))
    ]
    reported = attacked_cams("cam-acceleration", messages, factor_min=3.0, factor_max=3.0)
    assert accelerations(reported) == [3, -6, 16]
    drawn = accelerations(attacked_cams("cam-acceleration", messages))
    assert 2 <= drawn[0] <= 4.1
    assert drawn[1] == -2 * drawn[0] or abs(drawn[1] + 2 * drawn[0]) <= 0.2  # steps of 0.1, rounded up


def test_feigned_braking(attacked_cams):
    """Twice 2 m/s2 is 4; twice 0.1 is less than the least of 3. The foot is on the other pedal."""
    messages = [
        genuine(0, longitudinal_acceleration_mps2=2.0),
        genuine(100, longitudinal_acceleration_mps2=0.1, acceleration_control=None),
    ]
    reported = attacked_cams("cam-feigned-braking", messages, factor_min=2.0, factor_max=2.0, least_mps2=3.0)
    assert accelerations(reported) == [-4, -3]
    assert [cam.acceleration_control for cam in reported] == [BRAKE, BRAKE]
    assert [cam.speed_mps for cam in reported] == [10, 10]


def test_other_pedals_are_unchanged(attacked_cams):
    pedals = GAS | AccelerationControl.SPEED_LIMITER
    (reported,) = attacked_cams("cam-feigned-braking", [genuine(0, acceleration_control=pedals)])
    assert reported.acceleration_control == BRAKE | AccelerationControl.SPEED_LIMITER
