# SPDX-License-Identifier: BSD-3-Clause
"""Settings of Sphinx for the API reference that tools/docs.sh writes from the docstrings."""
project = "m2wr"
author = "m2wr maintainers"
copyright = "2026, m2wr maintainers"
extensions = ["sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "alabaster"
html_theme_options = {"page_width": "1100px"}
html_copy_source = False

napoleon_google_docstring = False
# types in docstrings say shapes and units, so they are text and no names of classes to link to
napoleon_preprocess_types = False
napoleon_use_param = False
napoleon_use_rtype = False
napoleon_use_ivar = True
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
# what a machine that only writes the reference need not have
autodoc_mock_imports = [
    "diagnostic_msgs", "gazebo_msgs", "genpy", "geometry_msgs", "m2wr_gmapping.srv", "m2wr_lockstep.srv",
    "message_filters", "nav_msgs", "rosbag", "rosgraph", "rosgraph_msgs", "roslaunch", "roslib", "rosnode", "rosparam",
    "rospkg", "rospy", "rosservice", "rostopic", "sensor_msgs", "std_msgs", "std_srvs", "tf", "tf2_msgs", "tf2_ros",
    "trajectory_msgs", "visualization_msgs",
]
