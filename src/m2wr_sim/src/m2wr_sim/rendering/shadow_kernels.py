# SPDX-License-Identifier: BSD-3-Clause
"""Which pixels a light reaches.  For the arrays see :mod:`picture_layout`.

A ray goes from the surface to the light.  Rays start at every fourth pixel in both directions; in pictures of 640
columns and more at every eighth, and so on.  Where the four rays around a block of pixels agree and begin on one part,
its pixels of this part take the result; other blocks are divided.  So the outline of a shadow is exact to a pixel; only
a shadow that is thinner than the distance of the first rays may be missing in places.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_sim.rendering.picture_layout import (
    BOX,
    CYLINDER,
    K_NORMAL,
    L_DIRECTIONAL,
    L_PLACE,
    MESH,
    P_HALF,
    P_KIND,
    P_MESH,
    P_POSITION,
    P_ROTATION,
    P_SHADOW,
    SPHERE,
    STACK,
    TREE_COUNT,
    TREE_LEAVES,
    TREE_NODES,
    TREE_ORDER,
    V_CENTRE_X,
    V_CENTRE_Y,
    V_FOCAL,
    V_POSITION,
    V_ROTATION,
)
from m2wr_sim.sensors.base_kernels import kernel

BLOCK = 4               # px between rays
FINEST = 160            # such distances in the width of a picture, at most twice as many
START = 1e-3            # m, and of the distance to the camera, by which a ray starts above its surface
FAR_AWAY = 1e9          # m; of a directional light
TINY = 1e-30            # least direction component
LIT, DARK, EMPTY = 1, 0, 2

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Bytes = NDArray[np.uint8]
    Depths = NDArray[np.float32]
    Floats = NDArray[np.float64]
    Numbers = NDArray[np.int32]
    Ray = Tuple[float, float, float]
    Whole = NDArray[np.int64]


@kernel
def _meets_box(o: Ray, inverse: Ray, hx: float, hy: float, hz: float, start: float, end: float) -> bool:
    """Return whether a ray meets a box around the origin between two distances; ``inverse`` is 1 / its direction."""
    sx, sy, sz = abs(inverse[0]) * hx, abs(inverse[1]) * hy, abs(inverse[2]) * hz
    mx, my, mz = o[0] * inverse[0], o[1] * inverse[1], o[2] * inverse[2]
    first = max(max(start, -mx - sx), max(-my - sy, -mz - sz))
    last = min(min(end, sx - mx), min(sy - my, sz - mz))
    return first <= last


@kernel
def _inverse(d: Ray) -> Ray:
    return 1.0 / (d[0] + TINY), 1.0 / (d[1] + TINY), 1.0 / (d[2] + TINY)


@kernel
def _meets_round(o: Ray, d: Ray, radius: float, half: float, flat: bool, start: float, end: float) -> bool:
    """Return whether a ray meets a cylinder (``flat``) or a sphere around the origin between two distances."""
    square, along, rest = d[0] * d[0] + d[1] * d[1], d[0] * o[0] + d[1] * o[1], o[0] * o[0] + o[1] * o[1] - radius ** 2
    if not flat:
        square, along, rest = square + d[2] * d[2], along + d[2] * o[2], rest + o[2] * o[2]
    root = along * along - square * rest
    if root < 0.0:
        return False
    root, square = math.sqrt(root), max(square, TINY)
    first, last = max(start, (-along - root) / square), min(end, (-along + root) / square)
    if flat:
        inverse = 1.0 / (d[2] + TINY)
        slab, middle = abs(inverse) * half, -o[2] * inverse
        first, last = max(first, middle - slab), min(last, middle + slab)
    return first <= last


@kernel
def _meets_triangle(o: Ray, d: Ray, triangles: Floats, face: int, start: float, end: float) -> bool:
    """Return whether a ray meets a triangle from either side (Möller and Trumbore)."""
    px = d[1] * triangles[face, 8] - d[2] * triangles[face, 7]
    py = d[2] * triangles[face, 6] - d[0] * triangles[face, 8]
    pz = d[0] * triangles[face, 7] - d[1] * triangles[face, 6]
    volume = triangles[face, 3] * px + triangles[face, 4] * py + triangles[face, 5] * pz
    if volume == 0.0:
        return False
    inverse = 1.0 / volume
    x, y, z = o[0] - triangles[face, 0], o[1] - triangles[face, 1], o[2] - triangles[face, 2]
    u = (x * px + y * py + z * pz) * inverse
    if not 0.0 <= u <= 1.0:
        return False
    qx, qy, qz = (y * triangles[face, 5] - z * triangles[face, 4], z * triangles[face, 3] - x * triangles[face, 5],
                  x * triangles[face, 4] - y * triangles[face, 3])
    v = (d[0] * qx + d[1] * qy + d[2] * qz) * inverse
    if not (v >= 0.0 and u + v <= 1.0):
        return False
    return start < (triangles[face, 6] * qx + triangles[face, 7] * qy + triangles[face, 8] * qz) * inverse < end


@kernel
def _meets_node(o: Ray, inverse: Ray, nodes: Floats, k: int, start: float, end: float) -> bool:
    return nodes[k, 3] >= 0.0 and _meets_box(
        (o[0] - nodes[k, 0], o[1] - nodes[k, 1], o[2] - nodes[k, 2]), inverse, nodes[k, 3], nodes[k, 4], nodes[k, 5],
        start, end)


@kernel
def _meets_mesh(o: Ray, d: Ray, tree: Whole, nodes: Floats, triangles: Floats, stack: Whole, base: int, start: float,
                end: float) -> bool:
    """Return whether a ray meets a triangle of a mesh; the stack is free from ``base`` on."""
    leaves, count, first_node = tree[TREE_LEAVES], tree[TREE_COUNT], tree[TREE_NODES]
    inverse = _inverse(d)
    stack[base], top = 0, base + 1
    while top > base:
        top -= 1
        k = stack[top]
        if not _meets_node(o, inverse, nodes, first_node + k, start, end):
            continue
        if k < leaves - 1:
            stack[top], stack[top + 1] = 2 * k + 1, 2 * k + 2
            top += 2
            continue
        leaf = k - (leaves - 1)
        for face in range(tree[TREE_ORDER] + leaf * count // leaves,
                          tree[TREE_ORDER] + (leaf + 1) * count // leaves):
            if _meets_triangle(o, d, triangles, face, start, end):
                return True
    return False


@kernel
def meets_part(point: Ray, ray: Ray, start: float, end: float, skip: int, parts: Floats, number: int, meshes: Whole,
               mesh_nodes: Floats, triangles: Floats, stack: Whole) -> bool:
    """Return whether a ray meets one part.

    Parameters
    ----------
    point, ray : (3,) float
        Start and unit direction [m, -].
    start, end : float
        Distances along the ray between which it counts [m].
    skip : int
        Row of the part on which the point lies: it shades itself only if it is a mesh.
    parts : (N, P) float64
    number : int
        Row of the part.
    meshes, mesh_nodes, triangles, stack
        As for :func:`blocked`.
    """
    kind = int(parts[number, P_KIND])
    if parts[number, P_SHADOW] == 0.0 or (number == skip and kind != MESH):
        return False
    x, y, z = (point[0] - parts[number, P_POSITION], point[1] - parts[number, P_POSITION + 1],
               point[2] - parts[number, P_POSITION + 2])
    a, b, c = P_ROTATION, P_ROTATION + 3, P_ROTATION + 6
    o = (parts[number, a] * x + parts[number, b] * y + parts[number, c] * z,
         parts[number, a + 1] * x + parts[number, b + 1] * y + parts[number, c + 1] * z,
         parts[number, a + 2] * x + parts[number, b + 2] * y + parts[number, c + 2] * z)
    d = (parts[number, a] * ray[0] + parts[number, b] * ray[1] + parts[number, c] * ray[2],
         parts[number, a + 1] * ray[0] + parts[number, b + 1] * ray[1] + parts[number, c + 1] * ray[2],
         parts[number, a + 2] * ray[0] + parts[number, b + 2] * ray[1] + parts[number, c + 2] * ray[2])
    if kind == BOX:
        return _meets_box(o, _inverse(d), parts[number, P_HALF], parts[number, P_HALF + 1], parts[number, P_HALF + 2],
                          start, end)
    if kind == MESH:
        return _meets_mesh(o, d, meshes[int(parts[number, P_MESH])], mesh_nodes, triangles, stack, STACK, start, end)
    if kind == SPHERE or kind == CYLINDER:
        return _meets_round(o, d, parts[number, P_HALF], parts[number, P_HALF + 2], kind == CYLINDER, start, end)
    return False


@kernel
def blocked(point: Ray, ray: Ray, start: float, end: float, skip: int, parts: Floats, tree: Whole, nodes: Floats,
            order: Whole, meshes: Whole, mesh_nodes: Floats, triangles: Floats, stack: Whole) -> int:
    """Return the row of a part of a tree that is on a ray, or -1.

    Parameters
    ----------
    point, ray : (3,) tuples
        Begin [m] and unit direction of the ray in the world.
    start, end : float
        Distances [m] between which a part counts.
    skip : int
        Row of the part on which the ray begins; a convex one does not hide itself.
    parts, tree, nodes, order, meshes, mesh_nodes, triangles : arrays
        See :mod:`picture_layout`.
    stack : (2 STACK,) int64
        Overwritten.
    """
    leaves, count = tree[TREE_LEAVES], tree[TREE_COUNT]
    if leaves == 0:
        return -1
    inverse = _inverse(ray)
    stack[0], top = 0, 1
    while top > 0:
        top -= 1
        k = stack[top]
        if not _meets_node(point, inverse, nodes, k, start, end):
            continue
        if k < leaves - 1:
            stack[top], stack[top + 1] = 2 * k + 1, 2 * k + 2
            top += 2
            continue
        leaf = k - (leaves - 1)
        for place in range(leaf * count // leaves, (leaf + 1) * count // leaves):
            if meets_part(point, ray, start, end, skip, parts, order[place], meshes, mesh_nodes, triangles, stack):
                return order[place]
    return -1


@kernel
def _point_of(j: int, i: int, depth: Depths, view: Floats) -> Ray:
    """Return the surface's point in the world at a pixel."""
    z = np.float64(depth[j, i])
    u, v = (i - view[V_CENTRE_X]) / view[V_FOCAL] * z, (j - view[V_CENTRE_Y]) / view[V_FOCAL] * z
    r = V_ROTATION
    return (view[V_POSITION] + view[r] * u + view[r + 1] * v + view[r + 2] * z,
            view[V_POSITION + 1] + view[r + 3] * u + view[r + 4] * v + view[r + 5] * z,
            view[V_POSITION + 2] + view[r + 6] * u + view[r + 7] * v + view[r + 8] * z)


@kernel
def _turned_away(parts: Floats, number: int, looks: Depths, face: int, ray: Ray) -> bool:
    """Return whether a triangle of a mesh is turned away from the light."""
    total = 0.0
    for a in range(3):
        row = P_ROTATION + 3 * a
        total += ray[a] * (parts[number, row] * looks[face, K_NORMAL]
                           + parts[number, row + 1] * looks[face, K_NORMAL + 1]
                           + parts[number, row + 2] * looks[face, K_NORMAL + 2])
    return total <= 0.0


@kernel
def _reached(j: int, i: int, depth: Depths, owner: Numbers, faces: Numbers, view: Floats, light: Floats, parts: Floats,
             trees: Whole, nodes: Floats, order: Whole, moving_nodes: Floats, moving_order: Whole, meshes: Whole,
             mesh_nodes: Floats, triangles: Floats, looks: Depths, stack: Whole) -> int:
    """Return LIT or DARK for one pixel.  The part that hid the pixel before is tried first; ``stack[-1]`` keeps it."""
    point, own = _point_of(j, i, depth, view), owner[j, i]
    ray, end = (light[L_PLACE], light[L_PLACE + 1], light[L_PLACE + 2]), FAR_AWAY
    if light[L_DIRECTIONAL] == 0.0:
        ray = ray[0] - point[0], ray[1] - point[1], ray[2] - point[2]
        end = max(math.sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]), TINY)
        ray = ray[0] / end, ray[1] / end, ray[2] / end
    if parts[own, P_KIND] == MESH and _turned_away(parts, own, looks, faces[j, i], ray):
        return LIT          # dark by its normal
    start, last = START * (1.0 + depth[j, i]), stack.shape[0] - 1
    if stack[last] >= 0 and meets_part(point, ray, start, end, own, parts, stack[last], meshes, mesh_nodes, triangles,
                                       stack):
        return DARK
    stack[last] = blocked(point, ray, start, end, own, parts, trees[0], nodes, order, meshes, mesh_nodes, triangles,
                          stack)
    if stack[last] < 0:
        stack[last] = blocked(point, ray, start, end, own, parts, trees[1], moving_nodes, moving_order, meshes,
                              mesh_nodes, triangles, stack)
    return DARK if stack[last] >= 0 else LIT


@kernel
def find_shadows(lit: Bytes, depth: Depths, owner: Numbers, faces: Numbers, view: Floats, light: Floats, parts: Floats,
                 trees: Whole, nodes: Floats, order: Whole, moving_nodes: Floats, moving_order: Whole, meshes: Whole,
                 mesh_nodes: Floats, triangles: Floats, looks: Depths) -> int:
    """Find the pixels that a light reaches.

    Parameters
    ----------
    lit : (height, width) uint8
        Written: 1 where it does.
    depth, owner, faces : arrays
        See :func:`~m2wr_sim.rendering.raster_kernels.draw_tree`.
    view, light, parts : arrays
        See :mod:`picture_layout`.
    trees : (2, TREE_SIZE) int64
        Of the static parts and of the moving ones.
    nodes, order, moving_nodes, moving_order : arrays
        Of the two trees.
    meshes, mesh_nodes, triangles, looks : arrays

    Returns
    -------
    int
        Number of rays.
    """
    height, width = depth.shape
    stack = np.empty(2 * STACK + 1, np.int64)
    stack[2 * STACK] = -1
    lit[:] = EMPTY
    rays = 0
    size = BLOCK
    while width >= FINEST * size:
        size *= 2
    while size >= 1:        # all corners of the large blocks, then of those that are not uniform, and so on
        for j0 in range(0, height + size - 1, size):
            j = min(j0, height - 1)
            for i0 in range(0, width + size - 1, size):
                i = min(i0, width - 1)
                if lit[j, i] == EMPTY and owner[j, i] >= 0:
                    lit[j, i] = _reached(j, i, depth, owner, faces, view, light, parts, trees, nodes, order,
                                         moving_nodes, moving_order, meshes, mesh_nodes, triangles, looks, stack)
                    rays += 1
        if size > 1:
            _fill_blocks(lit, owner, size)
        size //= 2
    return rays


@kernel
def _fill_blocks(lit: Bytes, owner: Numbers, size: int) -> None:
    """Fill each block whose corners agree; those of its pixels that belong to other parts stay empty."""
    height, width = lit.shape
    for j0 in range(0, height - 1, size):
        j1 = min(j0 + size, height - 1)
        for i0 in range(0, width - 1, size):
            i1 = min(i0 + size, width - 1)
            value, part = lit[j0, i0], owner[j0, i0]
            if (value == EMPTY or value != lit[j0, i1] or value != lit[j1, i0] or value != lit[j1, i1]
                    or part != owner[j0, i1] or part != owner[j1, i0] or part != owner[j1, i1]):
                continue
            for j in range(j0, j1 + 1):
                for i in range(i0, i1 + 1):
                    if lit[j, i] == EMPTY and owner[j, i] == part:
                        lit[j, i] = value
