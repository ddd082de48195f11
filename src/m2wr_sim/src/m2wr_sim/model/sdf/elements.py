# SPDX-License-Identifier: BSD-3-Clause
"""Elements of SDF: which are read, which have no effect on the simulation, which are reported and why.

Readers mark what they use; :class:`~m2wr_sim.model.sdf.node.Node` compares that with the
file.  These tables define how the rest is reported; docs/reference/sdf.md shows them
(``python3 -m m2wr_sim.model.sdf.elements`` prints its table), and tests hold both against the readers.  Elements of one
name in different places have rows of their own (``physics/ode``, ``friction/ode``).
"""
from __future__ import annotations

import re
import sys
from typing import FrozenSet, Iterable, List


def _words(text: str) -> FrozenSet[str]:
    return frozenset(text.split())


#: Row -> the elements in it that are read.
READ = {row: _words(text) for row, text in {
    "world": "model actor include light physics gravity plugin state frame scene",
    "scene": "ambient background sky shadows",
    "physics": "max_step_size real_time_update_rate gravity max_contacts ode",
    "physics/ode": "solver constraints",
    "solver": "type iters precon_iters sor",
    "constraints": "cfm erp contact_max_correcting_vel contact_surface_layer",
    "state": "sim_time model insertions deletions",
    "state/model": "pose scale link model",
    "state/link": "pose velocity",
    "deletions": "name",
    "insertions": "model actor include light",
    "include": "uri name pose static plugin placement_frame",
    "model": "pose static self_collide allow_auto_disable plugin link joint model include frame",
    "actor": "pose skin script plugin link joint",
    "skin": "filename scale",
    "actor/script": "loop delay_start auto_start trajectory",
    "trajectory": "waypoint",
    "waypoint": "time pose",
    "frame": "pose",
    "link": "pose inertial collision visual sensor gravity self_collide kinematic velocity_decay",
    "velocity_decay": "linear angular",
    "inertial": "pose mass inertia",
    "inertia": "ixx ixy ixz iyy iyz izz",
    "collision": "pose geometry surface laser_retro max_contacts",
    "visual": "pose geometry material transparency cast_shadows",
    "material": "ambient diffuse script",
    "script": "name uri",
    "geometry": "box cylinder sphere plane mesh heightmap polyline empty",
    "box": "size",
    "cylinder": "radius length",
    "sphere": "radius",
    "plane": "normal size",
    "mesh": "uri filename scale submesh",
    "submesh": "name center",
    "heightmap": "uri size pos sampling",
    "polyline": "point height",
    "surface": "friction contact bounce",
    "friction": "ode torsional",
    "friction/ode": "mu mu2 fdir1 slip1 slip2",
    "torsional": "coefficient use_patch_radius patch_radius surface_radius",
    "contact": "ode collide_bitmask collide_without_contact elastic_modulus",
    "contact/ode": "kp kd max_vel min_depth",
    "bounce": "restitution_coefficient threshold",
    "joint": "parent child pose axis axis2 physics thread_pitch screw_thread_pitch gearbox_ratio"
             " gearbox_reference_body",
    "joint/physics": "ode",
    "joint/ode": "limit fudge_factor",
    "ode/limit": "erp cfm",
    "parent": "link",
    "child": "link",
    "axis": "xyz use_parent_model_frame dynamics limit mimic",
    "mimic": "multiplier offset reference",
    "dynamics": "damping friction spring_stiffness spring_reference",
    "axis/limit": "lower upper effort velocity",
    "sensor": "pose update_rate always_on visualize plugin ray imu contact camera",
    "camera": "pose image clip noise distortion horizontal_fov",
    "image": "width height format",
    "clip": "near far",
    "distortion": "k1 k2 k3 p1 p2 center",
    "ray": "scan range noise",
    "scan": "horizontal vertical",
    "horizontal": "samples resolution min_angle max_angle",
    "vertical": "samples resolution min_angle max_angle",
    "range": "min max resolution",
    "noise": "type mean stddev bias_mean bias_stddev precision dynamic_bias_stddev dynamic_bias_correlation_time",
    "imu": "angular_velocity linear_acceleration noise",
    "angular_velocity": "x y z",
    "linear_acceleration": "x y z",
    "imu/axis": "noise",
    "imu/noise": "type rate accel",
    "rate": "mean stddev bias_mean bias_stddev",
    "sensor/contact": "collision",
    "light": "cast_shadows pose diffuse specular attenuation direction",
    "attenuation": "constant linear quadratic",
}.items()}

#: Row -> its elements without effect on the simulation; reported in one info line for a document.
QUIET = {row: _words(text) for row, text in {
    "world": "gui audio wind atmosphere magnetic_field spherical_coordinates road",
    "scene": "grid fog origin_visual",
    "physics": "real_time_factor bullet simbody dart magnetic_field",
    "solver": "min_step_size use_dynamic_moi_rescaling friction_model island_threads thread_position_correction",
    "state": "wall_time real_time iterations light joint",
    "state/model": "joint",
    "state/link": "acceleration wrench collision",
    "model": "enable_wind description author",
    "actor": "animation static enable_wind self_collide",
    "link": "enable_wind light audio_sink audio_source must_be_base_link projector particle_emitter",
    "visual": "laser_retro meta plugin visibility_flags",
    "material": "specular emissive lighting shader pbr shininess render_order double_sided",
    "heightmap": "texture blend use_terrain_paging",
    "surface": "soft_contact",
    "friction": "bullet",
    "torsional": "ode",
    "contact": "bullet poissons_ratio collide_without_contact_bitmask",
    "contact/ode": "soft_cfm soft_erp",
    "joint/physics": "simbody provide_feedback",
    "joint/ode": "provide_feedback cfm_damping implicit_spring_damper suspension",
    "axis": "initial_position",
    "axis/limit": "stiffness dissipation",
    "sensor": "topic depth gps sonar force_torque altimeter magnetometer rfid rfidtag transceiver "
              "logical_camera",
    "camera": "save depth_camera lens visibility_mask optical_frame_id",
    "imu": "topic",
    "sensor/contact": "topic",
    "light": "intensity spot light_on visualize",
    "attenuation": "range",
}.items()}

#: (row, element) -> why it is ignored; reported as a warning.
REASONS = {
    ("world", "population"): "write the models out, or spawn them",
    ("link", "battery"): "no charge is simulated",
    ("joint", "sensor"): "a force and torque plugin on the model reads joints",
    ("model", "gripper"): "a closed hand holds by friction alone",
    ("contact", "category_bitmask"): "<collide_bitmask> decides what collides",
    ("joint/ode", "cfm"): "<limit> in it is read",
    ("joint/ode", "erp"): "<limit> in it is read",
    ("joint/ode", "bounce"): "stops do not spring back",
    ("joint/ode", "max_force"): "drive plugins and services drive joints",
    ("joint/ode", "velocity"): "drive plugins and services drive joints",
    ("imu", "orientation_reference_frame"): "the orientation is in the world's axes; a plugin may turn it",
    ("imu", "enable_orientation"): "the orientation is always given",
    ("inertial", "density"): "<mass> and <inertia> are read",
}

#: (row, element) -> the value at which an element that is not read changes nothing, and is not reported; 0 is also
#: ``false``.
IDLE = {("physics", "real_time_factor"): 1.0, ("model", "enable_wind"): 0.0, ("link", "enable_wind"): 0.0,
        ("link", "must_be_base_link"): 0.0, ("joint/ode", "cfm"): 0.0, ("joint/ode", "erp"): 0.2,
        ("joint/ode", "bounce"): 0.0, ("joint/ode", "max_force"): 0.0, ("joint/ode", "velocity"): 0.0,
        ("contact", "category_bitmask"): 65535.0}

#: Row -> what differs from Gazebo, for docs/reference/sdf.md.
DIFFERS = {
    "world": "`plugin`: named and left out",
    "physics": "`max_step_size`: 0.01 to 100 ms; `type`: always ode",
    "solver": "`precon_iters` and `sor` are stored, without effect; `~solver` chooses the solver",
    "constraints": "`erp`: 0.2 to 0.8; the others are stored, without effect",
    "state": "only the first counts, as in Gazebo",
    "state/model": "`scale` other than 1 1 1 is reported and not applied",
    "include": "nothing is downloaded, also from a Fuel server; `placement_frame` names a link; with the attribute "
               "`merge` inside a `model` the links and joints keep their names",
    "model": "a `static` model inside of one that moves stays where it is; `gripper` has no effect",
    "actor": "pushes others, nothing moves it; `joint` is reported; visuals collide where nothing else of a link does",
    "skin": "a cylinder stands for the person; `script` and plugins move it",
    "trajectory": "attributes `id`, `type`, `tension`",
    "inertial": "the mass of a moving link must be positive",
    "scene": "`sky`: a clear one; for cameras",
    "visual": "for cameras and viewers; a `heightmap` is drawn where the link collides with it",
    "material": "of `ambient` and `diffuse` the latter; see [cameras](../how-to/cameras.md)",
    "geometry": "`image`, `capsule`, `ellipsoid`: reported, this shape is left out",
    "plane": "`size` is for cameras and viewers, as in Gazebo",
    "heightmap": "see [meshes](meshes.md)",
    "torsional": "reported where it would have an effect",
    "contact": "`elastic_modulus` other than 0 is reported",
    "contact/ode": "limited, see [physics](../explanation/physics.md)",
    "joint": "types revolute, continuous, prismatic, fixed, ball, universal, revolute2 (its suspension is "
             "rigid), screw, gearbox (wheels with parallel axes); the second axis of joint `j` is named `j::axis2`",
    "sensor": "types ray, gpu_ray, imu, contact, camera, depth, multicamera; others are reported",
    "range": "`resolution` has no effect, as in Gazebo",
    "noise": "`dynamic_bias_...`: of imu sensors, else reported",
    "light": "for cameras; spots shine as points; the first with `cast_shadows` has shadows",
}

#: Row -> attributes besides those that are read that are passed over: names for people and other programs.
SILENT_ATTRIBUTES = {"physics": ("name",), "state": ("world_name",), "xyz": ("expressed_in",)}

#: (row of the parent, element) -> row, where the element's own name is not one.
ROWS = {
    ("physics", "ode"): "physics/ode", ("friction", "ode"): "friction/ode", ("contact", "ode"): "contact/ode",
    ("actor", "script"): "actor/script", ("state", "model"): "state/model",
    ("state/model", "model"): "state/model", ("state/model", "link"): "state/link",
    ("joint", "physics"): "joint/physics", ("joint/physics", "ode"): "joint/ode", ("joint/ode", "limit"): "ode/limit",
    ("joint", "axis2"): "axis", ("axis", "limit"): "axis/limit", ("sensor", "contact"): "sensor/contact",
    ("angular_velocity", "x"): "imu/axis", ("angular_velocity", "y"): "imu/axis", ("angular_velocity", "z"): "imu/axis",
    ("linear_acceleration", "x"): "imu/axis", ("linear_acceleration", "y"): "imu/axis",
    ("linear_acceleration", "z"): "imu/axis", ("imu", "noise"): "imu/noise", ("imu/noise", "rate"): "rate",
    ("imu/noise", "accel"): "rate",
}


def table() -> List[str]:
    """Return the lines of the table in docs/reference/sdf.md: a row of elements in each."""
    lines = ["| in | read | differs from Gazebo | no effect, one INFO line | not read, reported |",
             "|---|---|---|---|---|"]
    for row in READ:
        reasons = ["`{}`: {}".format(tag, re.sub("(<.*?>)", r"`\1`", reason))
                   for (parent, tag), reason in REASONS.items() if parent == row]
        cells = "`%s`" % row, _listed(READ[row]), DIFFERS.get(row, ""), _listed(QUIET.get(row, ())), "; ".join(reasons)
        lines.append("| {} |".format(" | ".join(cells)).replace("  ", " "))
    return lines


def _listed(tags: Iterable[str]) -> str:
    return ", ".join("`{}`".format(tag) for tag in sorted(tags))


if __name__ == "__main__":
    sys.stdout.write("\n".join(table()) + "\n")
