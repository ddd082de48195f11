# SPDX-License-Identifier: BSD-3-Clause
"""Parameters that may change at run time."""


from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.ros.reconfigure import CHANGEABLE, changed, description


def test_only_dynamic_parameters_change():
    config = GmappingConfig.from_mapping({"particles": 7, "linearUpdate": 500})
    after = changed(config, {"linearUpdate": 2, "throttle_scans": 3.0, "particles": 9})
    assert (after["linearUpdate"], after["throttle_scans"], after["particles"]) == (2.0, 3, 7)
    told = description(config)
    assert set(told.defaults) == set(CHANGEABLE)
    assert told.max["linearUpdate"] == 500.0        # a value beyond the slider is no error
