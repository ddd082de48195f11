# SPDX-License-Identifier: BSD-3-Clause
"""Tracks of way points: the spline and the rotations of Gazebo, scripts, velocities without jumps."""
import math

import pytest

from m2wr_sim.control.pose_track import PoseScript, PoseTrack, rotation_rate, slerp
from m2wr_sim.geometry import quaternion_from_rpy, rpy_from_quaternion, yaw_of


def pose(x, y=0.0, z=0.0, yaw=0.0):
    return (x, y, z), quaternion_from_rpy(0.0, 0.0, yaw)


def test_track_passes_its_way_points_at_their_times():
    track = PoseTrack((0.0, 1.0, 4.0), (pose(0.0), pose(2.0, 1.0, 0.5, 1.0), pose(-3.0)))
    assert track.at(1.0)[0] == (2.0, 1.0, 0.5) and yaw_of(track.at(1.0)[1]) == pytest.approx(1.0)
    assert track.at(-1.0)[0] == (0.0, 0.0, 0.0) and track.at(9.0)[0] == (-3.0, 0.0, 0.0) and track.length == 4.0


def test_position_is_the_cardinal_spline_of_gazebo():
    """Hermite basis at a quarter; tangents are halves of differences, at an end too: 0.5 m, 1.5 m, 1 m."""
    track = PoseTrack((0.0, 2.0, 4.0), (pose(0.0), pose(1.0), pose(3.0)))
    t = 0.25
    hermite = 3 * t**2 - 2 * t**3 + (t**3 - 2 * t**2 + t) * 0.5 + (t**3 - t**2) * 1.5
    assert track.at(0.5)[0][0] == pytest.approx(hermite, abs=1e-12)
    last = 1.0 * (2 * t**3 - 3 * t**2 + 1) + 3.0 * (3 * t**2 - 2 * t**3) + (t**3 - 2 * t**2 + t) * 1.5 + (t**3 - t**2)
    assert track.at(2.5)[0][0] == pytest.approx(last, abs=1e-12)


def test_closed_track_has_one_tangent_at_its_seam():
    track = PoseTrack((0.0, 1.0, 2.0, 3.0), (pose(0.0), pose(1.0), pose(1.0, 1.0), pose(0.0)))
    before, after = track.at(3.0 - 1e-4)[0], track.at(1e-4)[0]
    assert [-value for value in before] == pytest.approx(list(after), abs=1e-6) and after[1] < 0.0


def test_tension_of_one_stops_at_way_points_and_none_is_straight():
    stop = PoseTrack((0.0, 1.0, 2.0), (pose(0.0), pose(1.0), pose(2.0)), 1.0)
    assert stop.at(1.001)[0][0] == pytest.approx(1.0 + 3e-6, abs=1e-7) and stop.at(0.5)[0][0] == 0.5
    straight = PoseTrack((0.0, 1.0, 3.0), (pose(0.0), pose(1.0), pose(2.0)), None)
    assert straight.at(0.3)[0][0] == pytest.approx(0.3) and straight.at(2.0)[0][0] == pytest.approx(1.5)


def test_first_time_counts_as_zero_as_in_gazebo():
    track = PoseTrack((3.0, 4.0), (pose(0.0), pose(1.0)), None)
    assert track.length == 4.0 and track.at(2.0)[0][0] == pytest.approx(0.5)


def test_turns_take_the_shorter_way():
    track = PoseTrack((0.0, 1.0), (pose(0.0, yaw=3.0), pose(0.0, yaw=-3.0)))
    assert abs(yaw_of(track.at(0.5)[1])) == pytest.approx(math.pi)
    half = slerp(0.5, quaternion_from_rpy(0.0, 0.0, 0.2), quaternion_from_rpy(0.0, 0.0, 1.0))
    assert yaw_of(half) == pytest.approx(0.6)


def test_squad_passes_orientations_that_differ_in_all_angles():
    angles = ((0.0, 0.0, 0.0), (0.5, 0.4, 0.9), (1.0, -0.3, 2.0))
    track = PoseTrack((0.0, 1.0, 2.0), [((0.0, 0.0, 0.0), quaternion_from_rpy(*three)) for three in angles])
    assert rpy_from_quaternion(track.at(1.0 - 1e-7)[1]) == pytest.approx(angles[1], abs=1e-5)
    assert rpy_from_quaternion(track.at(1.0 + 1e-5)[1]) == pytest.approx(angles[1], abs=1e-4)
    middle = track.at(0.5)[1]
    assert sum(value * value for value in middle) == pytest.approx(1.0) and middle != slerp(
        0.5, track.at(0.0)[1], track.at(1.0)[1])


@pytest.mark.parametrize("times", [(), (0.0, 0.0), (0.0, 2.0, 1.0), (0.0, math.nan), (0.0, math.inf)])
def test_times_that_do_not_ascend_are_refused(times):
    with pytest.raises(ValueError, match="ascending"):
        PoseTrack(times, [pose(0.0)] * len(times))


def test_script_plays_tracks_in_turn_and_waits_before_each_cycle():
    tracks = [PoseTrack((0.0, 2.0), (pose(0.0), pose(2.0)), None), PoseTrack((0.0, 1.0), (pose(5.0), pose(6.0)), None)]
    script = PoseScript(tracks, True, 1.0)
    found = [script.at(time)[0][0] for time in (0.5, 2.0, 3.5, 4.2, 6.0)]
    assert found == pytest.approx([0.0, 1.0, 5.5, 0.0, 1.0]) and script.end == math.inf
    once = PoseScript(tracks, False, 1.0)
    assert once.at(100.0)[0][0] == 6.0 and once.end == 4.0


def test_velocity_leads_to_the_next_pose_but_not_over_a_jump():
    track = PoseTrack((0.0, 2.0), (pose(0.0), pose(2.0, yaw=1.0)), None)
    script = PoseScript([track])
    motion = script.motion(0.5, 0.1)
    assert motion.linear == pytest.approx((1.0, 0.0, 0.0)) and motion.angular == pytest.approx((0.0, 0.0, 0.5))
    assert script.motion(1.95, 0.1).linear[0] == pytest.approx(0.5)         # to the end, not back to the begin
    closed = PoseScript([PoseTrack((0.0, 2.0, 4.0), (pose(0.0), pose(2.0), pose(0.0)), None)])
    assert closed.motion(3.95, 0.1).linear[0] == pytest.approx(0.0, abs=1e-9)
    assert closed.motion(3.9, 0.1).linear[0] == pytest.approx(-1.0)


def test_one_way_point_stays():
    script = PoseScript([PoseTrack((0.0,), (pose(3.0),))])
    assert script.at(7.0)[0][0] == 3.0 and script.motion(7.0, 0.1).linear == (0.0, 0.0, 0.0) and not script.loop


def test_rate_of_rotation_about_any_axis():
    begin = quaternion_from_rpy(0.3, -0.2, 0.7)
    assert rotation_rate(begin, begin, 0.1) == (0.0, 0.0, 0.0)
    rolled = quaternion_from_rpy(0.2, 0.0, 0.0)
    assert rotation_rate((0.0, 0.0, 0.0, 1.0), rolled, 0.1) == pytest.approx((2.0, 0.0, 0.0))
