# SPDX-License-Identifier: BSD-3-Clause
"""The targets of the fuzzer: one line each, ``name: "module:Class"``."""
import importlib

TARGETS = {
    "urdf": "target_documents:Urdf",
    "sdf": "target_documents:Sdf",
    "world": "target_documents:World",
    "spawn_text": "target_documents:Spawn",
    "services": "target_services:Services",
    "mesh": "target_files:MeshFile",
    "heights": "target_files:HeightFile",
    "map": "target_files:MapFiles",
    "bag": "target_files:BagFiles",
    "tour": "target_files:TourFile",
    "scans": "target_mapping:Scans",
    "state": "target_mapping:StateFile",
    "network": "target_network:Network",
    "parameters": "target_values:Parameters",
}


def make_target(name):
    """Return a new target; raises KeyError if there is none of that name."""
    module, _, attribute = TARGETS[name].partition(":")
    return getattr(importlib.import_module(module), attribute)()
