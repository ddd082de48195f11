# SPDX-License-Identifier: BSD-3-Clause
"""Nothing is compiled once the kernels are warm."""
import importlib
import pkgutil

import m2wr_gmapping
from m2wr_gmapping.kernel_warm_up import compile_kernels

MODULES = [found.name for found in pkgutil.walk_packages(m2wr_gmapping.__path__, "m2wr_gmapping.")
           if found.name.endswith("_kernels")] + ["m2wr_gmapping.frontend.track"]


def compiled():
    return {(module, name): len(kernel.signatures) for module in MODULES
            for name, kernel in vars(importlib.import_module(module)).items()
            if hasattr(kernel, "signatures")}


def test_warm_up_compiles_every_kernel(mapped):
    compile_kernels()
    before = compiled()
    assert len(before) > 15
    for parameters in (dict(minimumScore=1000.0), dict(compatible=True, laps=0.2), dict(lskip=1)):
        mapper, _, _ = mapped(**dict(dict(laps=1.2), **parameters))
        mapper.finish()
        mapper.occupancy()
        mapper.close()
    assert compiled() == before
