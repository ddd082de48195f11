# SPDX-License-Identifier: BSD-3-Clause
"""Dynamic parameters for ``dynamic_reconfigure``, from the tables of :mod:`m2wr_navigation.parameters`."""
from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Callable, Dict, List, Mapping

import rospy
from dynamic_reconfigure.server import Server

from m2wr_navigation.parameters import Parameter, converted

_KINDS = {bool: "bool", int: "int", float: "double", str: "str"}


def description(table: Mapping[str, Parameter], values: Mapping[str, Any]) -> SimpleNamespace:
    """Return what dynamic_reconfigure's generator would make of the changeable parameters of a table.

    Parameters
    ----------
    table : mapping of str to Parameter
    values : mapping of str to object
        Present value of each.
    """
    names = [name for name, parameter in table.items() if parameter.changeable]
    group = {"name": "Default", "type": "", "state": True, "cstate": "true", "id": 0, "parent": 0, "groups": [],
             "parameters": [{"name": name, "type": _KINDS[type(table[name].default)], "level": 1, "edit_method": "",
                             "description": table[name].meaning} for name in names]}
    ends: Dict[str, Dict[str, Any]] = {"min": {}, "max": {}}
    for name in names:
        parameter, kind = table[name], type(table[name].default)
        if kind is str:
            ends["min"][name] = ends["max"][name] = ""
        elif kind is bool:
            ends["min"][name], ends["max"][name] = False, True
        else:       # a number of the start outside the slider stays
            ends["min"][name] = kind(min(parameter.low, values[name]))
            ends["max"][name] = kind(max(parameter.high, values[name]))
    return SimpleNamespace(config_description=group, defaults={name: values[name] for name in names},
                           level={name: 1 for name in names}, all_level=1, **ends)


def serve(namespace: str, table: Mapping[str, Parameter], values: Mapping[str, Any],
          take: Callable[[Dict[str, Any]], object]) -> Server:
    """Serve ``set_parameters`` in a namespace, and write every value back to the parameter server.

    Parameters
    ----------
    namespace : str
        Such as ``~local_costmap``; ``~`` is the node's own.
    table : mapping of str to Parameter
    values : mapping of str to object
        Present value of each parameter, converted and clipped.
    take : callable
        Called with the values of all parameters of the table after each change, not for those of the start.

    Returns
    -------
    dynamic_reconfigure.server.Server
        Its ``update_configuration`` changes values from within the node.
    """
    place = namespace if namespace == "~" else namespace.rstrip("/") + "/"
    for name, value in values.items():
        rospy.set_param(place + name, value)
    started: List[bool] = []

    def change(config: Dict[str, Any], _: int) -> Dict[str, Any]:
        merged = dict(values)
        for name, parameter in table.items():
            if parameter.changeable and name in config:
                value = converted(parameter, config[name])
                config[name] = merged[name] = values[name] if value is None else value
        if started:
            take(merged)
        started.append(True)
        return config

    return Server(description(table, values), change, "" if namespace == "~" else place)
