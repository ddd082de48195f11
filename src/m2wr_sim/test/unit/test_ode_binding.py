# SPDX-License-Identifier: BSD-3-Clause
"""The search for ODE's Python module; that it finds the one of the system is shown by test/unit/test_wheel.py."""
import importlib.util

import pytest

from m2wr_sim.physics import ode_binding


def test_a_missing_binding_names_the_package(monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(ode_binding, "FOLDERS", (str(tmp_path),))
    with pytest.raises(ImportError, match="expected the package python3-pyode"):
        ode_binding.find_ode()


def test_a_binding_of_another_python_is_not_taken(monkeypatch, tmp_path):
    (tmp_path / "ode.cpython-27-x86_64-linux-gnu.so").write_bytes(b"")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(ode_binding, "FOLDERS", (str(tmp_path),))
    with pytest.raises(ImportError, match=str(tmp_path)):
        ode_binding.find_ode()
