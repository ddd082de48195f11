# SPDX-License-Identifier: BSD-3-Clause
"""Columns of the arrays that the kernels of this folder share.

``view`` (VIEW_SIZE,)
    Position of the camera in the world [m]; rotation world-from-optical, row-major (x right, y down, z forward); focal
    length [px]; principal point as the index of a pixel, (width - 1) / 2 and (height - 1) / 2; near and far limits of
    the depth [m].
``parts`` (N, PART_SIZE)
    One visible shape a row: position of its centre in the world [m]; rotation world-from-shape, row-major; half
    extents in its own frame [m] (radius first for round shapes); kind; number of its mesh; red, green, blue from 0 to 1
    (red below 0: those of the mesh); first row of its texture in ``images`` (-1: none); repeats of the texture over a
    face in two directions; centre of the shape in the frame whose pose is given [m]; half extents of the box around it
    in world axes [m]; 1 if it casts a shadow.
``nodes`` (K, 6)
    Boxes, centre and half extents.  A complete binary tree in heap order: the children of node i are 2 i + 1 and
    2 i + 2.
``tree`` (TREE_SIZE,) int64
    First node, first element of ``order``, number of elements, number of leaves (a power of two).
``meshes`` (M, TREE_SIZE) int64
    The tree of each mesh; its elements are triangles, which are sorted and need no ``order``.
``triangles`` (T, 9)
    First corner and the two edges from it, in the frame of the mesh's centre [m].
``looks`` (T, LOOK_SIZE) float32
    Of each triangle: unit normal; red, green, blue; first row of its texture (-1: none); u, v of the three corners.
``images`` (I, 4) int64, ``texels`` (B,) uint8
    Textures: start in ``texels``, width, height, rows of smaller versions that follow; each version has half the width
    and height of the one before.
``lights`` (L, LIGHT_SIZE)
    1 for a directional light, 0 for a point light; direction towards the light, or position; red, green, blue;
    constant, linear and quadratic attenuation; 1 if it casts shadows.
"""
from __future__ import annotations

BOX, SPHERE, CYLINDER, PLANE, MESH = 0, 1, 2, 3, 4

V_POSITION, V_ROTATION, V_FOCAL, V_CENTRE_X, V_CENTRE_Y, V_NEAR, V_FAR, VIEW_SIZE = 0, 3, 12, 13, 14, 15, 16, 17

P_POSITION, P_ROTATION, P_HALF, P_KIND, P_MESH, P_COLOUR, P_IMAGE, P_REPEAT = 0, 3, 12, 15, 16, 17, 20, 21
P_MIDDLE, P_BOX, P_SHADOW, PART_SIZE = 23, 26, 29, 30

TREE_NODES, TREE_ORDER, TREE_COUNT, TREE_LEAVES, TREE_SIZE = 0, 1, 2, 3, 4

K_NORMAL, K_COLOUR, K_IMAGE, K_UV, LOOK_SIZE = 0, 3, 6, 7, 13

L_DIRECTIONAL, L_PLACE, L_COLOUR, L_ATTENUATION, L_SHADOW, LIGHT_SIZE = 0, 1, 4, 7, 10, 11

TILE = 8                # px; side of the squares whose farthest depth is kept
STACK = 128             # of a descent; a tree has at most 40 levels
