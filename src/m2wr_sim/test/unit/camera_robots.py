# SPDX-License-Identifier: BSD-3-Clause
"""Models with one camera, for tests."""
from m2wr_sim.model.sdf.loader import load_sdf_models


def camera_model(library="libgazebo_ros_camera.so", tags="<cameraName>cam</cameraName>", kind="camera", width=32,
                 height=24, rate=20, inside="", fov=1.2, near=0.1, far=20, cameras=None, pose="0 0 0.5 0 0 0"):
    """Return a static model with a camera that looks along x, with the plugin's tags."""
    one = """<camera name="%s"><horizontal_fov>{fov}</horizontal_fov><image><width>{width}</width>
      <height>{height}</height>      {inside}</image><clip><near>{near}</near><far>{far}</far></clip></camera>"""
    views = "".join(one % name for name in (cameras or ("c",)))
    text = """<sdf version="1.6"><model name="eye"><static>1</static><pose>{pose}</pose><link name="link">
      <sensor name="s" type="{kind}"><update_rate>{rate}</update_rate>""" + views + """
      <plugin name="p" filename="{library}">{tags}</plugin></sensor></link></model></sdf>"""
    return load_sdf_models(text.format(**locals()), "eye.sdf")[0]
