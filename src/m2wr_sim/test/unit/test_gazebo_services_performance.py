# SPDX-License-Identifier: BSD-3-Clause
"""Performance metrics: rates between two messages, at most five a second, and nothing without a subscriber."""
import pytest

from m2wr_sim.ros.gazebo_services.performance import Performance


@pytest.fixture
def metrics(m2wr_rig):
    """Return a rig with m2wr, its Performance, and the hands of the clock it looks at."""
    rig, hands = m2wr_rig(), [0.0]
    return rig, Performance(rig.simulator, clock=lambda: hands[0]), hands


def test_rates_of_world_and_laser(metrics):
    rig, performance, hands = metrics
    for _ in range(3):
        rig.run(0.5)
        hands[0] += 0.25
        performance.turn()
    message = rig.messages("/~performance_metrics")[-1]
    assert message.real_time_factor == pytest.approx(2.0)
    assert [sensor.name for sensor in message.sensors] == ["laser"] or len(message.sensors) == 1
    laser = message.sensors[0]
    assert laser.sim_update_rate == pytest.approx(20.0) and laser.real_update_rate == pytest.approx(40.0)
    assert laser.fps == -1.0


def test_at_most_five_per_second_and_only_with_a_subscriber(metrics):
    rig, performance, hands = metrics
    port = rig.ports.topics["/~performance_metrics"]
    for tick in range(1, 101):
        hands[0] = 0.01 * tick
        performance.turn()
    assert 4 <= len(port.messages) <= 5
    port.listening = False
    hands[0] += 1.0
    performance.turn()
    assert len(port.messages) <= 5


def test_a_reset_gives_no_negative_factor(metrics):
    rig, performance, hands = metrics
    rig.run(1.0)
    hands[0] += 1.0
    performance.turn()
    rig.simulator.reset_simulation()
    hands[0] += 1.0
    performance.turn()
    assert rig.messages("/~performance_metrics")[-1].real_time_factor == 0.0
