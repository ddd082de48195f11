# SPDX-License-Identifier: BSD-3-Clause
"""Nothing is compiled once the kernels are warm."""
from m2wr_gmapping.kernel_warm_up import compile_kernels
from m2wr_node import kernel
from m2wr_node.kernel_progress import kernels


def compiled():
    return {name: len(getattr(found, "signatures", ())) for name, found in kernels("m2wr_gmapping").items()}


def refuse(self):
    raise AssertionError("%s is called with arguments that the library does not have" % self.py_func.__name__)


def test_warm_up_compiles_every_kernel(mapped, monkeypatch):
    compile_kernels()
    before = compiled()
    assert len(before) > 50
    monkeypatch.setattr(kernel.Kernel, "dispatcher", property(refuse))
    for parameters in (dict(minimumScore=1000.0), dict(compatible=True, laps=0.2), dict(lskip=1)):
        mapper, _, _ = mapped(**dict(dict(laps=1.2), **parameters))
        mapper.finish()
        mapper.occupancy()
        mapper.close()
    assert compiled() == before
