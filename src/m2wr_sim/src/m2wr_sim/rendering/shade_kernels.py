# SPDX-License-Identifier: BSD-3-Clause
"""Colour of each pixel from its surface, the lights and the textures.  For the arrays see :mod:`picture_layout`.

colour = own colour * (ambient light + sum over lights of light * max(0, cosine of the angle to the normal)), as Ogre's
fixed lighting without highlights.  A texture is read at the version whose texels are nearest to the pixel's size.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_sim.rendering.picture_layout import (
    BOX,
    CYLINDER,
    K_COLOUR,
    K_IMAGE,
    K_NORMAL,
    K_UV,
    L_ATTENUATION,
    L_COLOUR,
    L_DIRECTIONAL,
    L_PLACE,
    MESH,
    P_COLOUR,
    P_HALF,
    P_IMAGE,
    P_KIND,
    P_POSITION,
    P_REPEAT,
    P_ROTATION,
    PLANE,
    SPHERE,
    V_CENTRE_X,
    V_CENTRE_Y,
    V_FOCAL,
    V_POSITION,
    V_ROTATION,
)
from m2wr_sim.sensors.base_kernels import kernel

LEAST_SLANT = 0.05      # least cosine between ray and normal for the choice of a texture's version

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Bytes = NDArray[np.uint8]
    Depths = NDArray[np.float32]
    Floats = NDArray[np.float64]
    Numbers = NDArray[np.int32]
    Whole = NDArray[np.int64]


@kernel
def _byte(value: float) -> int:
    return int(min(max(value, 0.0), 1.0) * 255.0 + 0.5)


@kernel
def _texel(images: Whole, texels: Bytes, row: int, u: float, v: float, density: float, out: Floats) -> None:
    """Write the colour of a texture at u, v (0, 0 is its upper left corner), interpolated between four texels.

    ``density`` is the width of a pixel in widths of the texture.
    """
    wide = density * images[row, 1]
    last = row + images[row, 3]
    while wide > 1.42 and row < last:
        row, wide = row + 1, 0.5 * wide
    start, width, height = images[row, 0], images[row, 1], images[row, 2]
    x, y = (u - math.floor(u)) * width - 0.5, (v - math.floor(v)) * height - 0.5
    i, j = int(math.floor(x)), int(math.floor(y))
    fx, fy = x - i, y - j
    i0, i1 = (i + width) % width, (i + 1) % width
    j0, j1 = (j + height) % height, (j + 1) % height
    a, b = start + 3 * (j0 * width + i0), start + 3 * (j0 * width + i1)
    c, d = start + 3 * (j1 * width + i0), start + 3 * (j1 * width + i1)
    for channel in range(3):
        upper = texels[a + channel] * (1.0 - fx) + texels[b + channel] * fx
        lower = texels[c + channel] * (1.0 - fx) + texels[d + channel] * fx
        out[channel] *= (upper * (1.0 - fy) + lower * fy) / 255.0


@kernel
def _light(lights: Floats, ambient: Floats, normal: Floats, point: Floats, lit: int, shadowed: int,
           out: Floats) -> None:
    """Write the light on a surface; ``shadowed`` is the light that ``lit`` tells about, -1 if there is none."""
    for channel in range(3):
        out[channel] = ambient[channel]
    for k in range(lights.shape[0]):
        if k == shadowed and not lit:
            continue
        light = lights[k]
        x, y, z, strength = light[L_PLACE], light[L_PLACE + 1], light[L_PLACE + 2], 1.0
        if light[L_DIRECTIONAL] == 0.0:
            x, y, z = x - point[0], y - point[1], z - point[2]
            far = max(math.sqrt(x * x + y * y + z * z), 1e-9)
            x, y, z = x / far, y / far, z / far
            fall = light[L_ATTENUATION] + far * (light[L_ATTENUATION + 1] + far * light[L_ATTENUATION + 2])
            strength = 1.0 / fall if fall > 1e-9 else 1.0
        slope = normal[0] * x + normal[1] * y + normal[2] * z
        if slope > 0.0:
            for channel in range(3):
                out[channel] += strength * slope * light[L_COLOUR + channel]


@kernel
def _inside(parts: Floats, number: int, point: Floats, local: Floats) -> None:
    """Write a point of the world in the frame of a part."""
    x, y, z = (point[0] - parts[number, P_POSITION], point[1] - parts[number, P_POSITION + 1],
               point[2] - parts[number, P_POSITION + 2])
    for a in range(3):
        local[a] = (parts[number, P_ROTATION + a] * x + parts[number, P_ROTATION + 3 + a] * y
                    + parts[number, P_ROTATION + 6 + a] * z)


@kernel
def _outside(parts: Floats, number: int, x: float, y: float, z: float, out: Floats) -> None:
    """Write a direction in the frame of a part in world axes."""
    for a in range(3):
        row = P_ROTATION + 3 * a
        out[a] = parts[number, row] * x + parts[number, row + 1] * y + parts[number, row + 2] * z


@kernel
def _face_of(parts: Floats, number: int, kind: int, local: Floats) -> int:
    """Return which side of a box, cylinder or plane a point is on: 0 to 5 for -x, x, ... z; -1 for a round one."""
    if kind == PLANE:
        return 5
    if kind == SPHERE:
        return -1
    hx, hy, hz = parts[number, P_HALF], parts[number, P_HALF + 1], parts[number, P_HALF + 2]
    if kind == CYLINDER:
        radius = math.sqrt(local[0] * local[0] + local[1] * local[1])
        if radius * hz > abs(local[2]) * hx:
            return -1
        return 5 if local[2] > 0.0 else 4
    x, y, z = abs(local[0]) * hy * hz, abs(local[1]) * hx * hz, abs(local[2]) * hx * hy
    if x >= y and x >= z:
        return 1 if local[0] > 0.0 else 0
    if y >= z:
        return 3 if local[1] > 0.0 else 2
    return 5 if local[2] > 0.0 else 4


@kernel
def _normal_of(parts: Floats, number: int, kind: int, face: int, local: Floats, normal: Floats) -> None:
    """Write the unit normal, in the world, of a box, sphere, cylinder or plane."""
    if face >= 0:
        sign = 1.0 if face % 2 else -1.0
        _outside(parts, number, sign if face < 2 else 0.0, sign if 2 <= face < 4 else 0.0, sign if face >= 4 else 0.0,
                 normal)
        return
    x, y, z = local[0], local[1], local[2] if kind == SPHERE else 0.0
    scale = 1.0 / max(math.sqrt(x * x + y * y + z * z), 1e-12)
    _outside(parts, number, x * scale, y * scale, z * scale, normal)


@kernel
def _paint_part(parts: Floats, number: int, face: int, local: Floats, footprint: float, images: Whole, texels: Bytes,
                out: Floats) -> None:
    """Multiply ``out`` by the texture of a part; each face shows it upright, seen from outside."""
    hx, hy = max(parts[number, P_HALF], 1e-12), max(parts[number, P_HALF + 1], 1e-12)
    hz = max(parts[number, P_HALF + 2], 1e-12)
    size, v = 2.0 * hx, 0.5 - 0.5 * local[2] / hz
    if face < 0:
        u, size = math.atan2(local[1], local[0]) / (2.0 * math.pi) + 0.5, 2.0 * math.pi * hx
    elif face >= 4:
        u, v = 0.5 + 0.5 * (local[0] if face == 5 else -local[0]) / hx, 0.5 - 0.5 * local[1] / hy
    elif face >= 2:
        u = 0.5 + 0.5 * (-local[0] if face == 3 else local[0]) / hx
    else:
        u, size = 0.5 + 0.5 * (local[1] if face == 1 else -local[1]) / hy, 2.0 * hy
    repeat = parts[number, P_REPEAT]
    _texel(images, texels, int(parts[number, P_IMAGE]), u * repeat, v * parts[number, P_REPEAT + 1],
           footprint / size * repeat, out)


@kernel
def _paint_triangle(looks: Depths, triangles: Floats, face: int, image: int, local: Floats, footprint: float,
                    images: Whole, texels: Bytes, out: Floats) -> None:
    """Multiply ``out`` by a texture at a point of a triangle."""
    look, triangle = looks[face], triangles[face]
    x, y, z = local[0] - triangle[0], local[1] - triangle[1], local[2] - triangle[2]
    aa = triangle[3] * triangle[3] + triangle[4] * triangle[4] + triangle[5] * triangle[5]
    bb = triangle[6] * triangle[6] + triangle[7] * triangle[7] + triangle[8] * triangle[8]
    ab = triangle[3] * triangle[6] + triangle[4] * triangle[7] + triangle[5] * triangle[8]
    pa = x * triangle[3] + y * triangle[4] + z * triangle[5]
    pb = x * triangle[6] + y * triangle[7] + z * triangle[8]
    square = max(aa * bb - ab * ab, 1e-30)
    s, t = (bb * pa - ab * pb) / square, (aa * pb - ab * pa) / square
    au, av = look[K_UV + 2] - look[K_UV], look[K_UV + 3] - look[K_UV + 1]
    bu, bv = look[K_UV + 4] - look[K_UV], look[K_UV + 5] - look[K_UV + 1]
    u, v = look[K_UV] + s * au + t * bu, look[K_UV + 1] + s * av + t * bv
    density = math.sqrt(abs(au * bv - av * bu) / math.sqrt(square))        # widths of the texture in a metre
    _texel(images, texels, image, u, v, footprint * density, out)


@kernel
def _background(out: Bytes, j: int, i: int, view: Floats, u: float, v: float, sky: Floats) -> None:
    """Write the colour where there is no surface: ``sky`` holds the colour at the horizon and overhead."""
    row = V_ROTATION + 6
    up = (view[row] * u + view[row + 1] * v + view[row + 2]) / math.sqrt(u * u + v * v + 1.0)
    share = math.sqrt(max(up, 0.0))
    for channel in range(3):
        out[j, i, channel] = _byte(sky[channel] + share * (sky[3 + channel] - sky[channel]))


@kernel
def shade(colour: Bytes, depth: Depths, owner: Numbers, faces: Numbers, lit: Bytes, shadowed: int, view: Floats,
          parts: Floats, triangles: Floats, looks: Depths, images: Whole, texels: Bytes, lights: Floats,
          ambient: Floats, sky: Floats) -> None:
    """Colour a picture.

    Parameters
    ----------
    colour : (height, width, 3) uint8
        Written: red, green, blue.
    depth, owner, faces : arrays
        See :func:`~m2wr_sim.rendering.raster_kernels.draw_tree`.
    lit : (height, width) uint8
        Whether the light number ``shadowed`` reaches the surface.
    shadowed : int
        -1: no light has shadows, and ``lit`` is not read.
    view, parts, triangles, looks, images, texels, lights : arrays
        See :mod:`picture_layout`.
    ambient : (3,) float64
        Light from everywhere, red, green, blue.
    sky : (6,) float64
        Colour of the background at the horizon and overhead.
    """
    height, width = depth.shape
    step = 1.0 / view[V_FOCAL]
    distant = True
    for k in range(lights.shape[0]):
        distant = distant and lights[k, L_DIRECTIONAL] > 0.0
    point, local, normal, light, own = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    plain_sky = sky[0] == sky[3] and sky[1] == sky[4] and sky[2] == sky[5]
    for j in range(height):
        v = (j - view[V_CENTRE_Y]) * step
        last_owner, last_face, last_lit = -2, -2, -1        # of the pixel before, for which ``light`` is right
        kind, image, red, green, blue, flat = 0, -1, 0, 0, 0, False
        for i in range(width):
            number, face = owner[j, i], faces[j, i]
            u = (i - view[V_CENTRE_X]) * step
            if number < 0:
                if plain_sky and last_owner == -1:
                    for channel in range(3):
                        colour[j, i, channel] = colour[j, i - 1, channel]
                else:
                    _background(colour, j, i, view, u, v, sky)
                last_owner = -1
                continue
            reached = int(lit[j, i]) if shadowed >= 0 else 1
            if number != last_owner:
                kind = int(parts[number, P_KIND])
            if flat and number == last_owner and reached == last_lit and (
                    kind == PLANE or (kind == MESH and face == last_face)):
                colour[j, i, 0], colour[j, i, 1], colour[j, i, 2] = red, green, blue
                continue
            z = np.float64(depth[j, i])
            for a in range(3):
                row = V_ROTATION + 3 * a
                point[a] = view[V_POSITION + a] + z * (view[row] * u + view[row + 1] * v + view[row + 2])
            if kind != MESH:
                _inside(parts, number, point, local)
                face = _face_of(parts, number, kind, local)
                if flat and number == last_owner and reached == last_lit and face == last_face and kind == BOX:
                    colour[j, i, 0], colour[j, i, 1], colour[j, i, 2] = red, green, blue
                    continue
                _normal_of(parts, number, kind, face, local, normal)
            elif number != last_owner or face != last_face:
                _outside(parts, number, float(looks[face, K_NORMAL]), float(looks[face, K_NORMAL + 1]),
                         float(looks[face, K_NORMAL + 2]), normal)
            if not (distant and number == last_owner and face == last_face and reached == last_lit and face >= 0):
                _light(lights, ambient, normal, point, reached, shadowed, light)
            own[0], own[1], own[2] = (parts[number, P_COLOUR], parts[number, P_COLOUR + 1],
                                      parts[number, P_COLOUR + 2])
            image = int(parts[number, P_IMAGE])
            if kind == MESH and own[0] < 0.0:
                image = int(looks[face, K_IMAGE])
                for channel in range(3):
                    own[channel] = looks[face, K_COLOUR + channel]
            if image >= 0:
                rx = view[V_ROTATION] * u + view[V_ROTATION + 1] * v + view[V_ROTATION + 2]
                ry = view[V_ROTATION + 3] * u + view[V_ROTATION + 4] * v + view[V_ROTATION + 5]
                rz = view[V_ROTATION + 6] * u + view[V_ROTATION + 7] * v + view[V_ROTATION + 8]
                slant = abs(rx * normal[0] + ry * normal[1] + rz * normal[2]) / math.sqrt(u * u + v * v + 1.0)
                footprint = z * step / math.sqrt(max(slant, LEAST_SLANT))
                if kind == MESH:
                    _inside(parts, number, point, local)
                    _paint_triangle(looks, triangles, face, image, local, footprint, images, texels, own)
                else:
                    _paint_part(parts, number, face, local, footprint, images, texels, own)
            red, green, blue = _byte(own[0] * light[0]), _byte(own[1] * light[1]), _byte(own[2] * light[2])
            colour[j, i, 0], colour[j, i, 1], colour[j, i, 2] = red, green, blue
            flat = distant and image < 0
            last_owner, last_face, last_lit = number, face, reached
