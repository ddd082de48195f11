# SPDX-License-Identifier: BSD-3-Clause
"""The parts of nested and of merged models, as parts of the model around them."""
from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, List, Optional, Sequence, Tuple

from m2wr_sim.geometry import compose
from m2wr_sim.model.types import Inertial

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.sdf.node import Node
    from m2wr_sim.model.types import Joint, Link, Model, PluginSpec

    #: A nested model, its element, and the frame of its pose.
    Nested = Tuple[Model, Node, Optional[str]]


def scoped(prefix: str, model: Model, model_from_nested: Pose) -> Tuple[List[Link], List[Joint], List[str]]:
    """Return links, joints and nested names of a nested model, with names and poses in the outer model.

    Parameters
    ----------
    prefix : str
        Name of the nested model in the outer one.
    model : Model
    model_from_nested : pose
        Of its frame in the outer model.

    Returns
    -------
    list of Link, list of Joint, list of str
    """
    def scope(name: str) -> str:
        return name if name == "world" else prefix + "::" + name

    links = [replace(link, name=scope(link.name), pose=compose(model_from_nested, link.pose),
                     sensors=tuple(replace(sensor, plugins=tuple(replace(plugin, reference=scope(link.name))
                                                                 for plugin in sensor.plugins))
                                   for sensor in link.sensors)) for link in model.links]
    joints = [replace(joint, name=scope(joint.name), parent=scope(joint.parent), child=scope(joint.child))
              for joint in model.joints]
    return links, joints, [prefix] + [scope(name) for name in model.nested]


def settled(nested: Sequence[Nested], has_links: bool) -> Tuple[bool, List[Nested]]:
    """Return whether a model that is not static by its own tag cannot move, and the models inside of it.

    In Gazebo each nested model is static or not by its own tag, whatever that of the model around it says.  So a model
    without links of its own that has only static ones inside cannot move.  Otherwise the links of static models inside
    stay where they are, while others move.

    Parameters
    ----------
    nested : sequence of (Model, node, relative_to)
    has_links : bool
        Whether the model has links of its own.
    """
    if nested and not has_links and all(model.static for model, _, _ in nested):
        return True, list(nested)
    return False, [(_fastened(model) if model.static else model, node, frame) for model, node, frame in nested]


def _fastened(model: Model) -> Model:
    return replace(model, links=tuple(replace(link, kinematic=True, gravity=False, inertial=Inertial())
                                      for link in model.links))


def merges(node: Node) -> bool:
    """Return whether an ``<include>`` puts the parts of its model into the model around it (SDF 1.9)."""
    return node.element.tag == "include" and node.attribute("merge").lower() in ("true", "1")


def merged(inner: Model, model_from_inner: Pose, links: List[Link], joints: List[Joint],
           node: Node) -> Tuple[List[Link], List[Joint]]:
    """Return the links and joints of a merged model, under their own names.

    Parameters
    ----------
    inner : Model
    model_from_inner : pose
        Of its frame in the outer model.
    links, joints : lists of Link and Joint
        Those that the outer model has already.
    node : Node
        The include.

    Returns
    -------
    list of Link, list of Joint

    Raises
    ------
    XmlError
        If a name is taken.
    """
    for kind, own, others in (("link", inner.links, links), ("joint", inner.joints, joints)):
        taken = {other.name for other in others}
        for part in own:
            if part.name in taken:
                node.fail('{} "{}" of the merged model "{}" has the name of another one'.format(
                    kind, part.name, inner.name), "other names, or an include without merge")
    return ([replace(link, pose=compose(model_from_inner, link.pose)) for link in inner.links], list(inner.joints))


def merged_plugins(inner: Model, model_from_inner: Pose) -> List[PluginSpec]:
    """Return the plugins of a merged model, which are the outer one's now.

    Parameters
    ----------
    inner : Model
    model_from_inner : pose
        Of its frame in the outer model.

    Returns
    -------
    list of PluginSpec
    """
    return [replace(plugin, frame=compose(model_from_inner, plugin.frame)) if plugin.scope else plugin
            for plugin in inner.plugins]


def nested_plugins(model: Model, model_from_nested: Pose) -> List[PluginSpec]:
    """Return the model plugins of a nested model; they use its own names of links and joints.

    Parameters
    ----------
    model : Model
    model_from_nested : pose
        Of its frame in the outer model.

    Returns
    -------
    list of PluginSpec
    """
    return [replace(plugin, scope="::".join(filter(None, (model.name, plugin.scope))),
                    frame=compose(model_from_nested, plugin.frame)) for plugin in model.plugins]
