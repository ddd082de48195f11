# SPDX-License-Identifier: BSD-3-Clause
"""Find the nearest surface of each pixel.  For the arrays see :mod:`picture_layout`.

A descent of the tree of parts visits near boxes first.  A box is left out if it is outside of the picture, if no
pixel's centre lies in its outline, or if every square of pixels that it covers already shows something nearer.  So
hidden and distant parts cost no more than the few large boxes that contain them.  Within its outline each part is
intersected exactly with the ray of each pixel.  A ray is (u, v, 1) in optical axes, so its parameter is the depth.  As
in Gazebo only the outer sides of surfaces are seen, and only those beyond the near limit.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_sim.rendering.picture_layout import (
    BOX,
    CYLINDER,
    MESH,
    P_BOX,
    P_HALF,
    P_KIND,
    P_MESH,
    P_POSITION,
    P_ROTATION,
    PLANE,
    SPHERE,
    STACK,
    TILE,
    TREE_COUNT,
    TREE_LEAVES,
    TREE_NODES,
    TREE_ORDER,
    V_CENTRE_X,
    V_CENTRE_Y,
    V_FAR,
    V_FOCAL,
    V_NEAR,
    V_POSITION,
    V_ROTATION,
)
from m2wr_sim.sensors.base_kernels import kernel

MARGIN = 1e-3           # px; more than the rounding error of an outline
TINY = 1e-30            # least direction component

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Depths = NDArray[np.float32]
    Numbers = NDArray[np.int32]
    Whole = NDArray[np.int64]


@kernel
def outline(x: float, y: float, z: float, hx: float, hy: float, hz: float, view: Floats, rect: Whole,
            width: int, height: int) -> float:
    """Write the pixels that a box in optical axes may cover.

    Parameters
    ----------
    x, y, z : float
        Centre of the box [m].
    hx, hy, hz : float
        Half of its size [m].
    view : (V,) float64
        The camera.
    rect : (4,) int64
        Written: first column, last one, first row, last one.
    width, height : int
        Of the picture [px].

    Returns
    -------
    float
        Least depth of the box [m]; -1: it covers no pixel.
    """
    low, high = z - hz, z + hz
    if not (high > view[V_NEAR] and low < view[V_FAR]) or hx < 0.0:
        return -1.0
    low = max(low, view[V_NEAR])
    focal = view[V_FOCAL]
    left, right, top, bottom = x - hx, x + hx, y - hy, y + hy
    left = left / (low if left < 0.0 else high) * focal + view[V_CENTRE_X] - MARGIN
    right = right / (high if right < 0.0 else low) * focal + view[V_CENTRE_X] + MARGIN
    top = top / (low if top < 0.0 else high) * focal + view[V_CENTRE_Y] - MARGIN
    bottom = bottom / (high if bottom < 0.0 else low) * focal + view[V_CENTRE_Y] + MARGIN
    if not (right >= 0.0 and left <= width - 1.0 and bottom >= 0.0 and top <= height - 1.0):
        return -1.0
    rect[0] = int(math.ceil(max(left, 0.0)))
    rect[1] = int(math.floor(min(right, width - 1.0)))
    rect[2] = int(math.ceil(max(top, 0.0)))
    rect[3] = int(math.floor(min(bottom, height - 1.0)))
    if rect[0] > rect[1] or rect[2] > rect[3]:
        return -1.0
    return low


@kernel
def _tile_depth(depth: Depths, row: int, column: int) -> float:
    """Return the greatest depth in a square of pixels."""
    most = np.float32(0.0)
    for j in range(row * TILE, min((row + 1) * TILE, depth.shape[0])):
        for i in range(column * TILE, min((column + 1) * TILE, depth.shape[1])):
            most = max(most, depth[j, i])
    return float(most)


@kernel
def hidden(depth: Depths, tiles: Depths, rect: Whole, nearest: float) -> bool:
    """Return whether all squares of pixels in a rectangle show something nearer.

    Parameters
    ----------
    depth : (height, width) float32
        Of the picture so far [m].
    tiles : (rows, columns) float32
        Greatest depth in each square [m]; below 0: it is computed again.
    rect : (4,) int64
        First column, last one, first row, last one.
    nearest : float
        Depth [m].
    """
    for row in range(rect[2] // TILE, rect[3] // TILE + 1):
        for column in range(rect[0] // TILE, rect[1] // TILE + 1):
            if tiles[row, column] < 0.0:
                tiles[row, column] = _tile_depth(depth, row, column)
            if tiles[row, column] > nearest:
                return False
    return True


@kernel
def _changed(tiles: Depths, rect: Whole) -> None:
    for row in range(rect[2] // TILE, rect[3] // TILE + 1):
        for column in range(rect[0] // TILE, rect[1] // TILE + 1):
            tiles[row, column] = -1.0


@kernel
def _local(part: Floats, view: Floats, origin: Floats, turn: Floats) -> None:
    """Write the camera's position in a part's frame, and the rotation part-from-optical, row-major."""
    for a in range(3):
        origin[a] = 0.0
        for b in range(3):
            origin[a] += part[P_ROTATION + 3 * b + a] * (view[V_POSITION + b] - part[P_POSITION + b])
            total = 0.0
            for c in range(3):
                total += part[P_ROTATION + 3 * c + a] * view[V_ROTATION + 3 * c + b]
            turn[3 * a + b] = total


@kernel
def _draw_box(depth: Depths, owner: Numbers, rect: Whole, view: Floats, o: Floats, t: Floats, h: Floats,
              number: int) -> None:
    near = view[V_NEAR]
    step = 1.0 / view[V_FOCAL]
    hx, hy, hz, ox, oy, oz = h[0], h[1], h[2], o[0], o[1], o[2]
    for j in range(rect[2], rect[3] + 1):
        v = (j - view[V_CENTRE_Y]) * step
        bx, by, bz = t[1] * v + t[2] + TINY, t[4] * v + t[5] + TINY, t[7] * v + t[8] + TINY
        depths, owners = depth[j], owner[j]
        for i in range(rect[0], rect[1] + 1):
            u = (i - view[V_CENTRE_X]) * step
            ix, iy, iz = 1.0 / (t[0] * u + bx), 1.0 / (t[3] * u + by), 1.0 / (t[6] * u + bz)
            sx, sy, sz = abs(ix) * hx, abs(iy) * hy, abs(iz) * hz
            mx, my, mz = -ox * ix, -oy * iy, -oz * iz
            first = max(max(mx - sx, my - sy), mz - sz)
            last = min(min(mx + sx, my + sy), mz + sz)
            seen = (first <= last) & (first >= near) & (first < depths[i])
            depths[i] = np.float32(first) if seen else depths[i]
            owners[i] = np.int32(number) if seen else owners[i]


@kernel
def _draw_sphere(depth: Depths, owner: Numbers, rect: Whole, view: Floats, o: Floats, t: Floats, h: Floats,
                 number: int) -> None:
    near = view[V_NEAR]
    step = 1.0 / view[V_FOCAL]
    rest = o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - h[0] * h[0]
    px = t[0] * o[0] + t[3] * o[1] + t[6] * o[2]
    py = t[1] * o[0] + t[4] * o[1] + t[7] * o[2]
    pz = t[2] * o[0] + t[5] * o[1] + t[8] * o[2]
    for j in range(rect[2], rect[3] + 1):
        v = (j - view[V_CENTRE_Y]) * step
        depths, owners = depth[j], owner[j]
        for i in range(rect[0], rect[1] + 1):
            u = (i - view[V_CENTRE_X]) * step
            square = u * u + v * v + 1.0
            along = px * u + py * v + pz
            root = along * along - square * rest
            first = (-along - math.sqrt(max(root, 0.0))) / square
            seen = (root >= 0.0) & (first >= near) & (first < depths[i])
            depths[i] = np.float32(first) if seen else depths[i]
            owners[i] = np.int32(number) if seen else owners[i]


@kernel
def _draw_cylinder(depth: Depths, owner: Numbers, rect: Whole, view: Floats, o: Floats, t: Floats, h: Floats,
                   number: int) -> None:
    near = view[V_NEAR]
    step = 1.0 / view[V_FOCAL]
    radius, half = h[0], h[2]
    rest = o[0] * o[0] + o[1] * o[1] - radius * radius
    for j in range(rect[2], rect[3] + 1):
        v = (j - view[V_CENTRE_Y]) * step
        bx, by, bz = t[1] * v + t[2] + TINY, t[4] * v + t[5], t[7] * v + t[8] + TINY
        depths, owners = depth[j], owner[j]
        for i in range(rect[0], rect[1] + 1):
            u = (i - view[V_CENTRE_X]) * step
            dx, dy, dz = t[0] * u + bx, t[3] * u + by, t[6] * u + bz
            square, along = dx * dx + dy * dy, dx * o[0] + dy * o[1]
            root = along * along - square * rest
            depth_of_root = math.sqrt(max(root, 0.0))
            enter, leave = (-along - depth_of_root) / square, (-along + depth_of_root) / square
            slab, middle = abs(half / dz), -o[2] / dz
            first, last = max(enter, middle - slab), min(leave, middle + slab)
            seen = (root >= 0.0) & (first <= last) & (first >= near) & (first < depths[i])
            depths[i] = np.float32(first) if seen else depths[i]
            owners[i] = np.int32(number) if seen else owners[i]


@kernel
def _draw_plane(depth: Depths, owner: Numbers, rect: Whole, view: Floats, o: Floats, t: Floats, h: Floats,
                number: int) -> None:
    """Draw a rectangle in the plane z = 0 of its frame, seen from above."""
    near = view[V_NEAR]
    step = 1.0 / view[V_FOCAL]
    if o[2] <= 0.0:
        return
    for j in range(rect[2], rect[3] + 1):
        v = (j - view[V_CENTRE_Y]) * step
        bx, by, bz = t[1] * v + t[2], t[4] * v + t[5], t[7] * v + t[8] + TINY
        depths, owners = depth[j], owner[j]
        for i in range(rect[0], rect[1] + 1):
            u = (i - view[V_CENTRE_X]) * step
            first = -o[2] / (t[6] * u + bz)
            x, y = o[0] + first * (t[0] * u + bx), o[1] + first * (t[3] * u + by)
            seen = (first >= near) & (first < depths[i]) & (abs(x) <= h[0]) & (abs(y) <= h[1])
            depths[i] = np.float32(first) if seen else depths[i]
            owners[i] = np.int32(number) if seen else owners[i]


@kernel
def _draw_triangle(depth: Depths, owner: Numbers, faces: Numbers, tiles: Depths, rect: Whole, view: Floats, o: Floats,
                   t: Floats, triangle: Floats, number: int, face: int) -> None:
    """Draw one triangle of a mesh.

    A ray meets the plane of corners a, b, c, which are relative to the camera, at det(a, b, c) / ray . (a x b + b x c +
    c x a); it is inside if the three products ray . (a x b) and so on have one sign.
    """
    ax, ay, az = triangle[0] - o[0], triangle[1] - o[1], triangle[2] - o[2]
    nx = triangle[4] * triangle[8] - triangle[5] * triangle[7]
    ny = triangle[5] * triangle[6] - triangle[3] * triangle[8]
    nz = triangle[3] * triangle[7] - triangle[4] * triangle[6]
    volume = ax * nx + ay * ny + az * nz
    if not volume < 0.0:        # seen from its inner side
        return
    # corners in optical axes
    x0, y0, z0 = t[0] * ax + t[3] * ay + t[6] * az, t[1] * ax + t[4] * ay + t[7] * az, t[2] * ax + t[5] * ay + t[8] * az
    bx, by, bz = triangle[3], triangle[4], triangle[5]
    x1, y1, z1 = (x0 + t[0] * bx + t[3] * by + t[6] * bz, y0 + t[1] * bx + t[4] * by + t[7] * bz,
                  z0 + t[2] * bx + t[5] * by + t[8] * bz)
    cx, cy, cz = triangle[6], triangle[7], triangle[8]
    x2, y2, z2 = (x0 + t[0] * cx + t[3] * cy + t[6] * cz, y0 + t[1] * cx + t[4] * cy + t[7] * cz,
                  z0 + t[2] * cx + t[5] * cy + t[8] * cz)
    xl, xh = min(x0, min(x1, x2)), max(x0, max(x1, x2))
    yl, yh = min(y0, min(y1, y2)), max(y0, max(y1, y2))
    zl, zh = min(z0, min(z1, z2)), max(z0, max(z1, z2))
    height, width = depth.shape
    near = view[V_NEAR]
    if zl > near:       # the outline of the corners is tighter than that of their box
        focal = view[V_FOCAL]
        r0, r1, r2 = focal / z0, focal / z1, focal / z2
        left = min(x0 * r0, min(x1 * r1, x2 * r2)) + view[V_CENTRE_X] - MARGIN
        right = max(x0 * r0, max(x1 * r1, x2 * r2)) + view[V_CENTRE_X] + MARGIN
        top = min(y0 * r0, min(y1 * r1, y2 * r2)) + view[V_CENTRE_Y] - MARGIN
        bottom = max(y0 * r0, max(y1 * r1, y2 * r2)) + view[V_CENTRE_Y] + MARGIN
        if not (right >= 0.0 and left <= width - 1.0 and bottom >= 0.0 and top <= height - 1.0):
            return
        rect[0], rect[1] = int(math.ceil(max(left, 0.0))), int(math.floor(min(right, width - 1.0)))
        rect[2], rect[3] = int(math.ceil(max(top, 0.0))), int(math.floor(min(bottom, height - 1.0)))
        if rect[0] > rect[1] or rect[2] > rect[3]:
            return
    elif outline(0.5 * (xl + xh), 0.5 * (yl + yh), 0.5 * (zl + zh), 0.5 * (xh - xl), 0.5 * (yh - yl), 0.5 * (zh - zl),
                 view, rect, width, height) < 0.0:
        return
    # ray . (a x b) and so on; all at most 0 inside, as the triangle is seen from outside
    ax0, ay0, az0 = y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2
    ax1, ay1, az1 = y2 * z0 - z2 * y0, z2 * x0 - x2 * z0, x2 * y0 - y2 * x0
    ax2, ay2, az2 = y0 * z1 - z0 * y1, z0 * x1 - x0 * z1, x0 * y1 - y0 * x1
    step = 1.0 / view[V_FOCAL]
    drawn = False
    for j in range(rect[2], rect[3] + 1):
        v = (j - view[V_CENTRE_Y]) * step
        b0, b1, b2 = ay0 * v + az0, ay1 * v + az1, ay2 * v + az2
        for i in range(rect[0], rect[1] + 1):
            u = (i - view[V_CENTRE_X]) * step
            e0, e1, e2 = ax0 * u + b0, ax1 * u + b1, ax2 * u + b2
            if e0 <= 0.0 and e1 <= 0.0 and e2 <= 0.0:
                total = e0 + e1 + e2
                if total < 0.0:
                    first = volume / total
                    if near <= first < depth[j, i]:
                        depth[j, i] = np.float32(first)
                        owner[j, i] = np.int32(number)
                        faces[j, i] = np.int32(face)
                        drawn = True
    if drawn:
        _changed(tiles, rect)


@kernel
def _node_outline(node: Floats, o: Floats, t: Floats, view: Floats, rect: Whole, width: int, height: int) -> float:
    """Return :func:`outline` of a box in the frame of a mesh, or of the world."""
    x, y, z = node[0] - o[0], node[1] - o[1], node[2] - o[2]
    return outline(
        t[0] * x + t[3] * y + t[6] * z, t[1] * x + t[4] * y + t[7] * z, t[2] * x + t[5] * y + t[8] * z,
        abs(t[0]) * node[3] + abs(t[3]) * node[4] + abs(t[6]) * node[5] if node[3] >= 0.0 else -1.0,
        abs(t[1]) * node[3] + abs(t[4]) * node[4] + abs(t[7]) * node[5],
        abs(t[2]) * node[3] + abs(t[5]) * node[4] + abs(t[8]) * node[5], view, rect, width, height)


@kernel
def _farther(nodes: Floats, one: int, o: Floats, t: Floats) -> bool:
    """Return whether the first of two neighbouring boxes has the greater depth, along the optical axis."""
    first, second = nodes[one], nodes[one + 1]
    return (t[2] * (first[0] - second[0]) + t[5] * (first[1] - second[1]) + t[8] * (first[2] - second[2])) > 0.0


@kernel
def _draw_mesh(depth: Depths, owner: Numbers, faces: Numbers, tiles: Depths, rect: Whole, view: Floats, o: Floats,
               t: Floats, tree: Whole, nodes: Floats, triangles: Floats, number: int) -> None:
    height, width = depth.shape
    leaves, count = tree[TREE_LEAVES], tree[TREE_COUNT]
    first_node, first_face = tree[TREE_NODES], tree[TREE_ORDER]
    stack = np.empty(STACK, np.int64)
    stack[0], top = 0, 1
    while top > 0:
        top -= 1
        k = stack[top]
        nearest = _node_outline(nodes[first_node + k], o, t, view, rect, width, height)
        if nearest < 0.0 or hidden(depth, tiles, rect, nearest):
            continue
        if k >= leaves - 1:
            leaf = k - (leaves - 1)
            for face in range(first_face + leaf * count // leaves, first_face + (leaf + 1) * count // leaves):
                _draw_triangle(depth, owner, faces, tiles, rect, view, o, t, triangles[face], number, face)
        else:
            child = 2 * k + 1
            swap = _farther(nodes, first_node + child, o, t)
            stack[top], stack[top + 1] = (child, child + 1) if swap else (child + 1, child)
            top += 2


@kernel
def _draw_part(depth: Depths, owner: Numbers, faces: Numbers, tiles: Depths, rect: Whole, view: Floats, parts: Floats,
               k: int, meshes: Whole, mesh_nodes: Floats, triangles: Floats, o: Floats, t: Floats) -> None:
    """Draw one part; ``rect`` is its outline, ``o`` and ``t`` are overwritten."""
    part = parts[k]
    kind, half = int(part[P_KIND]), part[P_HALF:P_HALF + 3]
    _local(part, view, o, t)
    if kind == MESH:
        _draw_mesh(depth, owner, faces, tiles, rect, view, o, t, meshes[int(part[P_MESH])], mesh_nodes, triangles, k)
        return
    if kind == BOX:
        _draw_box(depth, owner, rect, view, o, t, half, k)
    elif kind == SPHERE:
        _draw_sphere(depth, owner, rect, view, o, t, half, k)
    elif kind == CYLINDER:
        _draw_cylinder(depth, owner, rect, view, o, t, half, k)
    elif kind == PLANE:
        _draw_plane(depth, owner, rect, view, o, t, half, k)
    _changed(tiles, rect)


@kernel
def part_outline(part: Floats, view: Floats, rect: Whole, width: int, height: int) -> Tuple[float, float]:
    """Write the outline of a part: that of its own box, or of its box in world axes, whichever is smaller.

    Parameters
    ----------
    part : (P,) float64
        Row of the part.
    view : (V,) float64
        The camera.
    rect : (4,) int64
        Written: first column, last one, first row, last one.
    width, height : int
        Of the picture [px].

    Returns
    -------
    least : float
        Least depth [m]; -1: it is outside of the picture.
    centre : float
        Depth of the centre [m].
    """
    x, y, z = (part[P_POSITION] - view[V_POSITION], part[P_POSITION + 1] - view[V_POSITION + 1],
               part[P_POSITION + 2] - view[V_POSITION + 2])
    a, b, c = V_ROTATION, V_ROTATION + 3, V_ROTATION + 6
    cx = view[a] * x + view[b] * y + view[c] * z
    cy = view[a + 1] * x + view[b + 1] * y + view[c + 1] * z
    cz = view[a + 2] * x + view[b + 2] * y + view[c + 2] * z
    reach = np.zeros(3)
    for column in range(3):
        one = 0.0       # extent of the box in its own axes along this optical axis
        other = 0.0     # of that in world axes
        for k in range(3):
            other += abs(view[V_ROTATION + 3 * k + column]) * part[P_BOX + k]
            along = 0.0
            for m in range(3):
                along += view[V_ROTATION + 3 * m + column] * part[P_ROTATION + 3 * m + k]
            one += abs(along) * part[P_HALF + k]
        reach[column] = min(one, other)
    return outline(cx, cy, cz, reach[0], reach[1], reach[2], view, rect, width, height), cz


@kernel
def draw_tree(depth: Depths, owner: Numbers, faces: Numbers, tiles: Depths, view: Floats, parts: Floats, tree: Whole,
              nodes: Floats, order: Whole, meshes: Whole, mesh_nodes: Floats, triangles: Floats) -> int:
    """Draw all parts of a tree.

    Parameters
    ----------
    depth : (height, width) float32
        Depth of the nearest surface so far [m]; the far limit where there is none.
    owner, faces : (height, width) int32
        Row of the part, and number of the triangle, of that surface.
    tiles : (rows, columns) float32
        Greatest depth in each square of ``TILE`` pixels, or -1 if it must be computed again.
    view : (VIEW_SIZE,) float64
    parts : (N, PART_SIZE) float64
    tree : (TREE_SIZE,) int64
    nodes : (K, 6) float64
    order : (n,) int64
    meshes : (M, TREE_SIZE) int64
    mesh_nodes : (L, 6) float64
    triangles : (T, 9) float64

    Returns
    -------
    int
        Number of boxes of the tree that were visited.
    """
    leaves, count = tree[TREE_LEAVES], tree[TREE_COUNT]
    if leaves == 0:
        return 0
    height, width = depth.shape
    origin, turn = np.empty(3), np.empty(9)
    world_origin, world_turn = view[V_POSITION:V_POSITION + 3], view[V_ROTATION:V_ROTATION + 9]
    rect, stack = np.zeros(4, np.int64), np.empty(STACK, np.int64)
    stack[0], top, visits = 0, 1, 0
    while top > 0:
        top -= 1
        k = stack[top]
        visits += 1
        nearest = _node_outline(nodes[k], world_origin, world_turn, view, rect, width, height)
        if nearest < 0.0 or hidden(depth, tiles, rect, nearest):
            continue
        if k >= leaves - 1:
            leaf = k - (leaves - 1)
            for place in range(leaf * count // leaves, (leaf + 1) * count // leaves):
                number = order[place]
                nearest, _ = part_outline(parts[number], view, rect, width, height)
                if nearest >= 0.0 and not hidden(depth, tiles, rect, nearest):
                    _draw_part(depth, owner, faces, tiles, rect, view, parts, number, meshes, mesh_nodes, triangles,
                               origin, turn)
        else:
            child = 2 * k + 1
            swap = _farther(nodes, child, world_origin, world_turn)
            stack[top], stack[top + 1] = (child, child + 1) if swap else (child + 1, child)
            top += 2
    return visits
