# SPDX-License-Identifier: BSD-3-Clause
"""What a controller counts for its next answer."""
from m2wr_lockstep.client.outputs import Outputs, Published


def test_outputs_tell_early_from_the_turns_own():
    outputs = Outputs()
    outputs.count("/cmd_vel")
    outputs.begin()
    outputs.count("/cmd_vel")
    outputs.count("/cmd_vel")
    outputs.count("/state")
    assert outputs.end() == {"/cmd_vel": Published(1, 2), "/state": Published(0, 1)}
    outputs.begin()
    assert outputs.end() == {}
