# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of a costmap: which layers it has, and where their parameters are, in all layouts in use."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Dict, List, Mapping, Tuple

from m2wr_navigation import registry
from m2wr_navigation.costmap import footprint
from m2wr_navigation.costmap.observation import SOURCE_PARAMETERS
from m2wr_navigation.parameters import Parameter, flag, read, text, unknown

#: Parameters in the namespace of the costmap.
COSTMAP_PARAMETERS: Dict[str, Parameter] = {
    "global_frame": text("map", "frame of the costmap"),
    "robot_base_frame": text("base_link", "frame of the robot"),
    "rolling_window": flag(False, "whether the costmap follows the robot", False),
    "track_unknown_space": flag(False, "whether cells of which nothing is known are unknown", False),
    "always_send_full_costmap": flag(False, "whether each message holds the whole grid", False),
    "transform_tolerance": Parameter(0.3, "s", 0.0, 10.0, "greatest age of the robot's pose"),
    "update_frequency": Parameter(5.0, "Hz", 0.0, 100.0, "rate of updates"),
    "publish_frequency": Parameter(0.0, "Hz", 0.0, 100.0, "rate of messages; 0: only the first to each subscriber"),
    "width": Parameter(10.0, "m", 0.0, 1e5, "width"),
    "height": Parameter(10.0, "m", 0.0, 1e5, "height"),
    "resolution": Parameter(0.05, "m", 0.001, 50.0, "side of a cell"),
    "origin_x": Parameter(0.0, "m", -1e6, 1e6, "x of the corner"),
    "origin_y": Parameter(0.0, "m", -1e6, 1e6, "y of the corner"),
    "footprint": text("[]", "corners of the robot, [[x, y], ...]; empty: a circle", True),
    "robot_radius": Parameter(0.46, "m", 0.0, 10.0, "radius of a round robot"),
    "footprint_padding": Parameter(0.01, "m", 0.0, 10.0, "added to the footprint"),
    "least_clearance": Parameter(0.0, "m", 0.0, 10.0, "distance from obstacles that plans keep where there is no other "
                                 "way; for a footprint that is the disc in which a robot turns. 0: the inscribed "
                                 "radius"),
}
MOST_CELLS = 200000000
# parameters that pre-hydro files have in the costmap's namespace, by the layer to which they belong
_STATIC = ("map_topic", "unknown_cost_value", "lethal_cost_threshold", "track_unknown_space", "first_map_only",
           "subscribe_to_updates", "use_maximum", "trinary_costmap")
_OBSTACLE = ("max_obstacle_height", "raytrace_range", "obstacle_range", "track_unknown_space", "observation_sources",
             "footprint_clearing_enabled", "combination_method")
_VOXEL = (*_OBSTACLE, "origin_z", "z_resolution", "z_voxels", "unknown_threshold", "mark_threshold",
          "publish_voxel_map")
_INFLATION = ("cost_scaling_factor", "inflation_radius", "inflate_unknown")
_OWNED = {"StaticLayer": _STATIC, "ObstacleLayer": _OBSTACLE, "VoxelLayer": _VOXEL, "InflationLayer": _INFLATION}
_KNOWN_BESIDE = {"plugins", "static_map", "map_type", "footprint_topic", "published_footprint_topic", "obstacle_range",
                 "raytrace_range", "footprint_layer", "groups"}


@dataclass(frozen=True)
class LayerSetting:
    """One layer of a costmap.

    Attributes
    ----------
    name : str
        Namespace of its parameters, below that of the costmap.
    kind : str
        Its type, as :mod:`m2wr_navigation.registry` knows it.
    given : dict of str to object
        What files say about it, from wherever they say it.
    """

    name: str
    kind: str
    given: Dict[str, Any]


def layer_settings(given: Mapping[str, Any], place: str) -> Tuple[List[LayerSetting], List[str]]:
    """Return the layers of a costmap, and warnings.

    With ``plugins`` these are its layers, and parameters of the costmap's namespace count for them, too. Without, it is
    a file from before 2014: a static layer with ``static_map``, then obstacles and inflation.

    Parameters
    ----------
    given : mapping of str to object
        The costmap's namespace on the parameter server.
    place : str
        Its name, for messages.

    Returns
    -------
    layers : list of LayerSetting
    warnings : list of str
    """
    warnings: List[str] = []
    if "plugins" in given:
        listed = []
        for entry in given["plugins"] if isinstance(given["plugins"], list) else []:
            if isinstance(entry, dict) and isinstance(entry.get("name"), str) and isinstance(entry.get("type"), str):
                listed.append((entry["name"], entry["type"]))
            else:
                warnings.append("parameter {}/plugins has the entry {!r}; expected a name and a type".format(
                    place, entry))
        warnings += ["parameter {}/{} has no effect beside plugins".format(place, name)
                     for name in ("static_map", "map_type") if name in given]
    else:
        voxel = given.get("map_type") == "voxel"
        listed = [("static_layer", "costmap_2d::StaticLayer")] if given.get("static_map", False) is True else []
        listed += [("obstacle_layer", "costmap_2d::VoxelLayer" if voxel else "costmap_2d::ObstacleLayer"),
                   ("inflation_layer", "costmap_2d::InflationLayer")]
    layers = []
    for name, kind in listed:
        short = registry.short_name(kind)
        own = given.get(name)
        merged = {key: given[key] for key in _OWNED.get(short, ()) if key in given}
        merged.update(own if isinstance(own, dict) else {})
        if short in ("ObstacleLayer", "VoxelLayer"):        # what the start before has written must not win
            merged.update((source, given[source]) for source in _sources(given) if isinstance(given.get(source), dict))
        layers.append(LayerSetting(name, kind, merged))
    return layers, warnings


def _sources(given: Mapping[str, Any]) -> List[str]:
    names = given.get("observation_sources", "")
    return names.split() if isinstance(names, str) else []


def source_settings(layer: LayerSetting, place: str) -> Tuple[Dict[str, Dict[str, Any]], List[str]]:
    """Return the values of each observation source of an obstacle layer, and warnings.

    Parameters
    ----------
    layer : LayerSetting
    place : str
        Namespace of the costmap, for messages.

    Returns
    -------
    sources : dict of str to dict
        Value of each of ``SOURCE_PARAMETERS``, by the name of the source.
    warnings : list of str
    """
    sources: Dict[str, Dict[str, Any]] = {}
    warnings: List[str] = []
    for name in _sources(layer.given):
        own = layer.given.get(name)
        where = "{}/{}/{}".format(place, layer.name, name)
        if not isinstance(own, dict):
            warnings.append("{} has no parameters; expected at least data_type and topic; it is not used".format(where))
            continue
        inherited = {key: layer.given[key] for key in ("obstacle_range", "raytrace_range") if key in layer.given}
        sources[name], found = read(SOURCE_PARAMETERS, dict(inherited, **own), where)
        warnings += found + unknown(own, SOURCE_PARAMETERS, where)
        values = sources[name]
        if values["data_type"] not in ("LaserScan", "PointCloud", "PointCloud2"):
            warnings.append(
                "{}/data_type is {!r}; expected LaserScan, PointCloud or PointCloud2; the source is not used".format(
                    where, values["data_type"]))
            del sources[name]
        elif values["clearing"] and values["raytrace_range"] < values["obstacle_range"]:
            warnings.append("{}: raytrace_range {:g} m is below obstacle_range {:g} m: obstacles between stay for ever"
                            .format(where, values["raytrace_range"], values["obstacle_range"]))
    return sources, warnings


def unknown_names(given: Mapping[str, Any], layers: List[LayerSetting], place: str) -> List[str]:
    """Return one sentence for each parameter of a costmap and its layers that has no effect.

    Parameters
    ----------
    given : mapping of str to object
        The costmap's namespace.
    layers : list of LayerSetting
    place : str
    """
    known = set(COSTMAP_PARAMETERS) | _KNOWN_BESIDE | {layer.name for layer in layers}
    known.update(name for names in _OWNED.values() for name in names)
    for layer in layers:
        known.update(_sources(layer.given))
    sentences = unknown((name for name in given if not isinstance(given[name], dict)), known, place)
    for layer in layers:
        own = given.get(layer.name)
        if isinstance(own, dict):
            table = registry.find(registry.LAYERS, layer.kind).PARAMETERS
            sentences += unknown(own, set(table) | set(_sources(layer.given)) | _KNOWN_BESIDE,
                                 "{}/{}".format(place, layer.name))
    return sentences


def footprint_of(given: Mapping[str, Any], values: Mapping[str, Any]) -> Tuple[Any, str]:
    """Return the padded footprint (K, 2) of the parameters [m], and why that of the parameters is not used, if so.

    Parameters
    ----------
    given : mapping of str to object
        With ``footprint``, if there is one.
    values : mapping of str to object
        Of :data:`COSTMAP_PARAMETERS`.

    Returns
    -------
    corners : (K, 2) float64
    fault : str
    """
    outline, fault = given.get("footprint", "[]"), ""
    corners = footprint.circle(max(values["robot_radius"], 0.001))
    if outline not in ("", "[]", [], None):
        try:
            corners = footprint.parse(outline)
        except footprint.FootprintError as error:
            fault = "{}; a circle of {:g} m is used".format(error, values["robot_radius"])
    return footprint.padded(corners, values["footprint_padding"]), fault


def size_fault(values: Mapping[str, Any]) -> str:
    """Return why a costmap of this size cannot be made, or an empty text."""
    cells = values["width"] * values["height"] / values["resolution"] ** 2
    if not math.isfinite(cells) or cells > MOST_CELLS:
        return "{:g} x {:g} m in cells of {:g} m are {:.3g} cells; expected at most {:g}".format(
            values["width"], values["height"], values["resolution"], cells, MOST_CELLS)
    return ""
