# SPDX-License-Identifier: BSD-3-Clause
"""ROS as a Foxglove client uses it: serialised messages, parameters, files of packages."""
from __future__ import annotations

import os
import re
import struct
import xmlrpc.client
from typing import Any, Callable, Dict, List, Pattern, Sequence

import genpy
import rosgraph
import rospkg
import rospy

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.ros.classes import Classes
from m2wr_bridge.ros.graph import RosGraph
from m2wr_bridge.ros.publications import Publications
from m2wr_bridge.ros.subscriptions import legal, serialised
from m2wr_bridge.rosbridge.session import QUEUE

_KEEP = 1.0                 # s for which a topic that no client publishes any more is kept
_LARGEST = 64 << 20         # bytes of a file
_ASSET = re.compile(r"package://([A-Za-z]\w*)/(.+)", re.ASCII)
#: Files that a description of a robot names: meshes and their pictures and materials.
_ENDINGS = (".bmp", ".dae", ".glb", ".gltf", ".jpeg", ".jpg", ".mtl", ".obj", ".png", ".stl", ".tga", ".tif", ".tiff",
            ".urdf", ".xacro")


def patterns(name: str) -> List[Pattern[str]]:
    """Return the regular expressions of a parameter; by default one that fits all names.

    Parameters
    ----------
    name : str

    Raises
    ------
    BridgeError
        If it is no list of regular expressions.
    """
    given = rospy.get_param("~" + name, [".*"])
    try:
        return [re.compile(text) for text in ([given] if isinstance(given, str) else given)]
    except (re.error, TypeError) as error:
        raise BridgeError("parameter ~%s is %r (%s); expected a list of regular expressions" % (
            name, given, error)) from error


def fits(name: str, allowed: Sequence[Pattern[str]]) -> bool:
    """Return whether a name fits one of the patterns.

    Parameters
    ----------
    name : str
    allowed : sequence of Pattern
    """
    return any(pattern.fullmatch(name) for pattern in allowed)


def _decoded(kind: Any, payload: bytes) -> Any:
    """Return the message in bytes that a client has sent."""
    message = kind()
    try:
        message.deserialize(payload)
        whole = len(serialised(message)) == len(payload)
    except (genpy.DeserializationError, struct.error, ValueError, MemoryError) as error:
        raise BridgeError("%d bytes are no %s: %s" % (len(payload), kind._type, error)) from error
    if not whole:
        raise BridgeError("%d bytes are more than a %s" % (len(payload), kind._type))
    return message


class FoxgloveGraph:
    """Implements :class:`m2wr_bridge.foxglove.session.Graph` with rospy."""

    def __init__(self) -> None:
        self._ros = RosGraph(_KEEP)
        self.classes: Classes = self._ros.classes
        self._publications: Publications = self._ros.publications
        self.subscribe, self.unsubscribe = self._ros.subscribe, self._ros.unsubscribe
        self.unadvertise: Callable[[str, object], None] = self._publications.unadvertise
        self._client_topics, self._parameters = patterns("client_topic_whitelist"), patterns("param_whitelist")

    def offer(self, topic: str, type_name: str, holder: object) -> None:
        """Publish a topic for a holder.

        Parameters
        ----------
        topic, type_name : str
        holder : object

        Raises
        ------
        BridgeError
            If the topic is not allowed or has another type.
        """
        if not fits(legal("topic", topic), self._client_topics):
            raise BridgeError("topic %s is not among those that ~client_topic_whitelist allows" % topic)
        self._publications.advertise(topic, type_name, holder, False, QUEUE)

    def publish_raw(self, topic: str, payload: bytes) -> None:
        """Publish a serialised message.

        Parameters
        ----------
        topic : str
        payload : bytes

        Raises
        ------
        BridgeError
            If the bytes are no message of the topic's type.
        """
        self._publications.publish(topic, _decoded(self._publications.kind(topic), payload))

    def call_raw(self, service: str, type_name: str, payload: bytes) -> bytes:
        """Return the serialised answer to a serialised request.

        Parameters
        ----------
        service, type_name : str
        payload : bytes

        Raises
        ------
        BridgeError
            If the bytes are no request, or the service refuses.
        """
        kind = self.classes.service(type_name)
        return serialised(self._ros.request(service, kind, _decoded(kind._request_class, payload)))

    def parameters(self, names: List[str]) -> Dict[str, Any]:
        """Return the values of parameters, of all that are allowed for an empty list; what has none is left out.

        Raises
        ------
        BridgeError
            If the master does not answer.
        """
        try:
            found = [name for name in names or rospy.get_param_names() if fits(name, self._parameters)]
            return {name: value for name, value in ((name, rospy.get_param(name, None)) for name in found)
                    if isinstance(value, (bool, int, float, str, list, dict))}
        except (OSError, rosgraph.MasterException, rospy.ROSException, xmlrpc.client.Error, ValueError) as error:
            raise BridgeError("parameters: %s" % error) from error

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter; a value of None deletes it.

        Parameters
        ----------
        name : str
        value : object

        Raises
        ------
        BridgeError
            If it is not allowed.
        """
        name = legal("parameter", name)
        if not fits(name, self._parameters):
            raise BridgeError("parameter %s is not among those that ~param_whitelist allows" % name)
        try:
            if value is not None:
                rospy.set_param(name, value)
            elif rospy.has_param(name):
                rospy.delete_param(name)
        except (OSError, rosgraph.MasterException, rospy.ROSException, xmlrpc.client.Error, OverflowError, TypeError,
                ValueError) as error:
            raise BridgeError("parameter %s: %s" % (name, error)) from error

    def asset(self, uri: str) -> bytes:
        """Return the content of a mesh or picture of a package.

        Raises
        ------
        BridgeError
            If it is none, is outside of the package, or is too large.
        """
        match = _ASSET.fullmatch(uri)
        if match is None or os.path.splitext(uri)[1].lower() not in _ENDINGS:
            raise BridgeError("%s: expected package://NAME/PATH of a file that ends with %s" % (
                uri[:200], ", ".join(_ENDINGS)))
        try:
            folder = os.path.realpath(rospkg.RosPack().get_path(match.group(1)))
        except rospkg.ResourceNotFound:
            raise BridgeError("%s: package %s is not on ROS_PACKAGE_PATH" % (uri[:200], match.group(1))) from None
        try:
            path = os.path.realpath(os.path.join(folder, match.group(2)))
            if not path.startswith(folder + os.sep) or not os.path.isfile(path):
                raise BridgeError("%s: there is no such file in the package" % uri[:200])
            if os.path.getsize(path) > _LARGEST:
                raise BridgeError("%s has %d bytes; expected at most %d" % (uri[:200], os.path.getsize(path), _LARGEST))
            with open(path, "rb") as stream:
                return stream.read()
        except (OSError, ValueError) as error:
            raise BridgeError("%s: %s" % (uri[:200], error)) from error
