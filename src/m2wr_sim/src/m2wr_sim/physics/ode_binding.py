# SPDX-License-Identifier: BSD-3-Clause
"""Finds the module ``ode``, also from a virtual environment that does not see the packages of the system."""
from __future__ import annotations

import glob
import importlib.machinery
import importlib.util
import os
import sys
import sysconfig

#: Where distributions put modules for their own Python.
FOLDERS = ("/usr/lib/python3/dist-packages", "/usr/local/lib/python3/dist-packages",
           "/usr/lib/python%d.%d/site-packages" % sys.version_info[:2])


def find_ode() -> None:
    """Make ``import ode`` work, where the system has ODE's binding for this version of Python.

    Raises
    ------
    ImportError
        If there is none; the text names the package.
    """
    if importlib.util.find_spec("ode") is not None:
        return
    ending = str(sysconfig.get_config_var("EXT_SUFFIX"))
    files = [path for folder in FOLDERS for path in glob.glob(os.path.join(glob.escape(folder), "ode" + ending))]
    if not files:
        raise ImportError(
            "the physics engine ODE is not there: no module \"ode\" for Python %d.%d, neither in this environment nor "
            "in %s; expected the package python3-pyode of Debian or Ubuntu "
            "(sudo apt-get install python3-pyode) and the Python of the system"
            % (sys.version_info[:2] + (", ".join(FOLDERS),)))
    loader = importlib.machinery.ExtensionFileLoader("ode", files[0])
    spec = importlib.util.spec_from_file_location("ode", files[0], loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    sys.modules["ode"] = module
