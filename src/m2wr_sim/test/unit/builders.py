# SPDX-License-Identifier: BSD-3-Clause
"""Models made in one line, for tests of this package and of m2wr_tools."""
import math

from m2wr_sim.model.types import Box, Collision, Cylinder, Inertial, Link, Model, Plane, Sphere, Surface


def at(x=0.0, y=0.0, z=0.0, yaw=0.0):
    """Return a pose that stands upright."""
    return ((x, y, z), (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)))


def one_link(name, geometry, pose, static=True, mass=1.0, surface=Surface(), **link_values):
    """Return a model of one link with one collision; a movable one gets the inertia of a solid body."""
    if isinstance(geometry, Box):
        x, y, z = geometry.size
        inertia = (mass * (y * y + z * z) / 12, 0, 0, mass * (x * x + z * z) / 12, 0, mass * (x * x + y * y) / 12)
    elif isinstance(geometry, Sphere):
        inertia = (0.4 * mass * geometry.radius ** 2, 0, 0, 0.4 * mass * geometry.radius ** 2, 0,
                   0.4 * mass * geometry.radius ** 2)
    else:
        inertia = (0.1 * mass, 0, 0, 0.1 * mass, 0, 0.1 * mass)
    link = Link("link", inertial=Inertial(mass, inertia=inertia),
                collisions=(Collision("collision", geometry, surface=surface),), **link_values)
    return Model(name, (link,), pose=pose, static=static)


def ground(mu=100.0):
    """Return the ground plane of Gazebo's empty world."""
    return one_link("ground_plane", Plane(size=(100.0, 100.0)), at(), surface=Surface(mu=mu, mu2=50.0))


def box(name, x, y, z, size=(0.5, 0.5, 0.5), **values):
    """Return a box with its centre at (x, y, z); static unless told otherwise."""
    return one_link(name, Box(size), at(x, y, z), **values)


def sphere(name, x, y, z, radius=0.25, **values):
    """Return a sphere with its centre at (x, y, z)."""
    return one_link(name, Sphere(radius), at(x, y, z), **values)


def cylinder(name, x, y, z, radius=0.25, length=1.0, **values):
    """Return an upright cylinder with its centre at (x, y, z)."""
    return one_link(name, Cylinder(radius, length), at(x, y, z), **values)
