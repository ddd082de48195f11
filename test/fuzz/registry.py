"""What is fuzzed: one line a target, ``name: "module:Class"``."""
import importlib

TARGETS = {
    "urdf": "target_documents:Urdf",
    "sdf": "target_documents:Sdf",
    "world": "target_documents:World",
    "spawn_text": "target_documents:Spawn",
    "services": "target_services:Services",
}


def make_target(name):
    """Return a new target; raises KeyError if there is none of that name."""
    module, _, attribute = TARGETS[name].partition(":")
    return getattr(importlib.import_module(module), attribute)()
