# SPDX-License-Identifier: BSD-3-Clause
"""An rviz configuration for the published topics.  No ROS here."""
from __future__ import annotations

from typing import Any, Dict, Iterable, List, Optional, Tuple

import yaml

_SHOWN = {'sensor_msgs/LaserScan': 'rviz/LaserScan', 'nav_msgs/OccupancyGrid': 'rviz/Map',
          'visualization_msgs/MarkerArray': 'rviz/MarkerArray', 'visualization_msgs/Marker': 'rviz/Marker',
          'sensor_msgs/PointCloud2': 'rviz/PointCloud2', 'nav_msgs/Path': 'rviz/Path'}
_SCAN_LOOK = {'Style': 'Flat Squares', 'Size (m)': 0.04, 'Color Transformer': 'FlatColor', 'Color': '255; 64; 64'}


def namespace_of(name: str) -> str:
    """Return the namespace of a resolved name without slashes around it; '' for the root."""
    return name.strip('/').rpartition('/')[0]


def fixed_frame(odometry_topics: Iterable[str]) -> str:
    """Return the frame to draw in: ``odom``, with the namespace of the first robot if none is in the root namespace."""
    namespaces = sorted(namespace_of(topic) for topic in odometry_topics)
    return (namespaces[0] + '/odom').lstrip('/') if namespaces else 'odom'


def make_view(published: Iterable[Tuple[str, str]], descriptions: Iterable[str], frame: Optional[str] = None) -> str:
    """Return the text of an rviz configuration.

    Parameters
    ----------
    published : iterable of (str, str)
        Topics and their types.
    descriptions : iterable of str
        Parameters that hold a robot description.
    frame : str, optional
        Fixed frame; by default made from the odometry topics.

    Returns
    -------
    str
    """
    topics = sorted((topic, kind) for topic, kind in published)
    frame = frame or fixed_frame([topic for topic, kind in topics if kind == 'nav_msgs/Odometry'])
    displays: List[Dict[str, Any]] = [
        {'Class': 'rviz/Grid', 'Name': 'Floor', 'Cell Size': 1, 'Plane Cell Count': 20, 'Value': True},
        {'Class': 'rviz/TF', 'Name': 'TF', 'Marker Scale': 0.5, 'Show Names': False, 'Value': True}]
    for parameter in sorted(descriptions) or ['/robot_description']:
        prefix = namespace_of(parameter)
        displays.append({'Class': 'rviz/RobotModel', 'Name': ('Robot ' + prefix).strip(),
                         'Robot Description': parameter.strip('/'), 'TF Prefix': prefix, 'Value': True})
    for topic, kind in topics:
        if kind in _SHOWN:
            display = {'Class': _SHOWN[kind], 'Name': topic, 'Value': True}
            display['Marker Topic' if 'Marker' in kind else 'Topic'] = topic
            if kind == 'sensor_msgs/LaserScan':
                display.update(_SCAN_LOOK)
            displays.append(display)
    text: str = yaml.safe_dump({
        'Panels': [{'Class': 'rviz/Displays', 'Name': 'Displays'}, {'Class': 'rviz/Views', 'Name': 'Views'}],
        'Visualization Manager': {
            'Class': '', 'Displays': displays, 'Value': True,
            'Global Options': {'Fixed Frame': frame, 'Background Color': '48; 48; 48', 'Frame Rate': 30},
            'Tools': [{'Class': 'rviz/' + tool} for tool in ('MoveCamera', 'Select', 'Measure')],
            'Views': {'Current': {'Class': 'rviz/Orbit', 'Name': 'Current View', 'Target Frame': frame,
                                  'Distance': 22, 'Pitch': 1.1, 'Yaw': 3.14159}}},
        'Window Geometry': {'Height': 900, 'Width': 1280}}, default_flow_style=False, sort_keys=False)
    return text
