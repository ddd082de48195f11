# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of the nodes: values of any type, as a parameter server may hold them."""
import mutations
from harness import Target

_VALUES = (None, True, False, 0, 1, -1, 2 ** 31, 2 ** 70, 0.0, 0.5, -0.5, 1e-9, 1e9, 1e400, -1e400, float("nan"), "",
           "0.5", "1e-3", "nan", "true", "x" * 500, "../..", [], [1], ["/a"], ["/a -> /b by /c once"], [None], [[1]],
           {}, {"a": 1}, {"m2wr": "kinetic"}, {1: 2}, [{"/a": "/b"}], "native", "pyode", "step", "quick", "noetic",
           "rep103", b"bytes")


class Parameters(Target):
    """Parameters of the simulation and of the mapper."""

    name, weight = "parameters", 0.3

    def prepare(self):
        from dataclasses import fields

        from m2wr_gmapping.config import ConfigError, GmappingConfig
        from m2wr_sim.errors import SimError
        from m2wr_sim.ros.params import NodeConfig, read_config
        self.read, self.config, self.foreseen = read_config, GmappingConfig, (SimError, ConfigError)
        self.names = [entry.name for entry in fields(NodeConfig)] + ["nothing", "gazebo"]
        self.mapper_names = sorted(GmappingConfig.from_mapping({}).values)

    def make(self, rng):
        names = self.names if rng.randrange(2) else self.mapper_names
        return [(rng.choice(names), rng.choice(_VALUES + mutations.NUMBERS)) for _ in range(rng.randrange(1, 6))]

    def run(self, case):
        for reader in (self.read, self.config.from_mapping):
            try:
                reader(dict(case))
            except self.foreseen:
                pass
