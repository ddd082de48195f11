# SPDX-License-Identifier: BSD-3-Clause
"""Python classes of messages and services by name."""
from __future__ import annotations

import re
from typing import Any, Dict, Optional

import roslib.message
import rospkg

from m2wr_bridge.errors import BridgeError

_NAME = re.compile(r"[A-Za-z]\w*/[A-Za-z]\w*", re.ASCII)


class Classes:
    """Finds classes; only of packages that ROS knows, as a name comes from a client and finding imports it."""

    def __init__(self) -> None:
        self._packages: Any = rospkg.RosPack()
        self._found: Dict[str, Any] = {}

    def message(self, name: str) -> Any:
        """Return the class of a message type.

        Raises
        ------
        BridgeError
            If it is not there.
        """
        return self._find("message", name, roslib.message.get_message_class)

    def service(self, name: str) -> Any:
        """Return the class of a service type.

        Raises
        ------
        BridgeError
            If it is not there.
        """
        return self._find("service", name, roslib.message.get_service_class)

    def _find(self, kind: str, name: str, find: Any) -> Any:
        key = kind + " " + name
        found: Optional[Any] = self._found.get(key)
        if found is not None:
            return found
        name = "std_msgs/Header" if name == "Header" else name
        if not _NAME.fullmatch(name):
            raise BridgeError("%s type %r; expected package/Name" % (kind, name[:100]))
        package = name.partition("/")[0]
        try:
            self._packages.get_path(package)
            found = find(name)
        except rospkg.ResourceNotFound:
            raise BridgeError("%s type %s: package %s is not on ROS_PACKAGE_PATH" % (kind, name, package)) from None
        except (ImportError, ValueError, AttributeError) as error:
            raise BridgeError("%s type %s cannot be imported: %s" % (kind, name, error)) from error
        if found is None:
            raise BridgeError("%s type %s: package %s has no such type, or is not built" % (kind, name, package))
        self._found[key] = found
        return found
