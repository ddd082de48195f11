# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of known scenes: where shapes appear, how far they are, what hides them, how they are lit."""
import math

import numpy as np
import pytest

from m2wr_sim.geometry import compose, invert, quaternion_from_rpy, rotate
from m2wr_sim.model.mesh.surfaces import Surface, plain_surface
from m2wr_sim.model.mesh.textures import Texture
from m2wr_sim.rendering import picture_layout as layout
from m2wr_sim.rendering.camera import Camera
from m2wr_sim.rendering.picture_scene import Lighting, Part, PictureScene

HERE = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
RED, GREEN, WHITE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 1.0)
BACKGROUND = 179            # 0.7


def scene_of(*parts, moving=False, lights=()):
    """A scene of (Part, pose) pairs without lights: colours are 0.4 of the parts' own."""
    scene = PictureScene()
    scene.add_all([part for part, _ in parts], [pose for _, pose in parts], "all", moving)
    scene.lighting = Lighting(np.array(lights).reshape(-1, layout.LIGHT_SIZE))
    return scene


def picture(scene, width=160, height=120, view=1.2, pose=HERE, near=0.1, far=50.0):
    camera = Camera(width, height, view, near, far)
    camera.pose[0] = tuple(pose[0]) + tuple(pose[1])
    camera.take(scene)
    return camera


def pixels_of(camera, points, pose=HERE):
    """Column, row and depth of points in the world, by the pinhole formula in double precision."""
    found = []
    for point in points:
        x, y, z = compose(invert(pose), (point, (0.0, 0.0, 0.0, 1.0)))[0]
        found.append((0.5 * (camera.width - 1) - camera.focal * y / x, 0.5 * (camera.height - 1) - camera.focal * z / x,
                      x))
    return np.array(found)


def box_corners(half, pose):
    return [tuple(np.add(pose[0], rotate(pose[1], (sx * half[0], sy * half[1], sz * half[2]))))
            for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]


def surface_of_box(half):
    """The box as twelve triangles, counter-clockwise seen from outside."""
    corners = np.array(box_corners(half, HERE))
    centre, triangles = corners.mean(axis=0), []
    for axis in range(3):
        for sign in (-1, 1):
            face = [corner for corner in corners if np.sign(corner[axis]) == sign]
            face.sort(key=lambda corner: math.atan2(*(np.delete(corner, axis)[::-1])))
            normal = np.cross(np.subtract(face[1], face[0]), np.subtract(face[2], face[0]))
            if np.dot(normal, face[0] - centre) < 0:
                face.reverse()
            triangles += [(face[0], face[1], face[2]), (face[0], face[2], face[3])]
    return plain_surface(np.array(triangles), RED)


@pytest.mark.parametrize("kind", ["box", "mesh"])
@pytest.mark.parametrize("seed", range(6))
def test_outline_of_a_box_is_that_of_its_projected_corners(kind, seed):
    from scipy.spatial import ConvexHull
    rng = np.random.default_rng(seed)
    half = tuple(rng.uniform(0.1, 0.6, 3))
    pose = (tuple(rng.uniform((2.0, -0.8, -0.5), (4.0, 0.8, 0.5))), quaternion_from_rpy(*rng.uniform(-3, 3, 3)))
    eye = (tuple(rng.uniform(-0.3, 0.3, 3)), quaternion_from_rpy(*rng.uniform(-0.2, 0.2, 3)))
    part = Part(layout.BOX, half, RED) if kind == "box" else Part(layout.MESH, surface_of_box(half), RED)
    camera = picture(scene_of((part, pose)), pose=eye)
    places = pixels_of(camera, box_corners(half, pose), eye)
    hull = ConvexHull(places[:, :2])
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    grid = np.stack((columns, rows), axis=-1)
    outside = (grid @ hull.equations[:, :2].T + hull.equations[:, 2]).max(axis=-1)     # signed distance [px]
    seen = camera.depth < camera.far
    assert seen.sum() > 100
    assert not np.any(seen & (outside > 1e-3)) and not np.any(~seen & (outside < -1e-3))
    assert abs(camera.depth[seen].min() - places[:, 2].min()) < 0.05


def test_box_and_its_triangles_have_the_same_depths():
    half, pose = (0.4, 0.3, 0.5), ((3.0, 0.2, 0.1), quaternion_from_rpy(0.3, 0.5, 0.7))
    one = picture(scene_of((Part(layout.BOX, half, RED), pose)))
    two = picture(scene_of((Part(layout.MESH, surface_of_box(half), RED), pose)))
    both = (one.depth < one.far) & (two.depth < two.far)
    assert both.sum() > 1000 and ((one.depth < one.far) != (two.depth < two.far)).sum() <= 2
    np.testing.assert_allclose(one.depth[both], two.depth[both], rtol=1e-5)


def test_depth_is_along_the_optical_axis():
    camera = picture(scene_of((Part(layout.BOX, (0.5, 50.0, 50.0), RED), ((5.5, 0.0, 0.0), HERE[1]))))
    np.testing.assert_allclose(camera.depth, 5.0, rtol=1e-6)


@pytest.mark.parametrize("kind, half", [(layout.SPHERE, (0.5, 0.5, 0.5)), (layout.CYLINDER, (0.5, 0.5, 0.7))])
def test_round_shapes_have_the_depth_of_the_ray_that_meets_them(kind, half):
    camera = picture(scene_of((Part(kind, half, RED), ((3.0, 0.0, 0.0), HERE[1]))), 161, 121)
    assert abs(camera.depth[60, 80] - 2.5) < 1e-6
    for column in range(40, 120, 7):        # in the middle row both are circles
        slope = (column - 80) / camera.focal
        root = 9.0 - (1.0 + slope * slope) * (9.0 - 0.25)
        expected = (3.0 - math.sqrt(root)) / (1.0 + slope * slope) if root > 0 else camera.far
        assert abs(camera.depth[60, column] - expected) < 1e-4


def test_floor_ends_at_its_edges_and_is_seen_from_above_only():
    floor = Part(layout.PLANE, (4.0, 4.0, 0.0), WHITE)
    camera = picture(scene_of((floor, ((0.0, 0.0, -1.0), HERE[1]))))
    rows = np.arange(camera.height) - 0.5 * (camera.height - 1)
    expected = np.where(rows > 0, camera.focal / np.maximum(rows, 1e-9), np.inf)
    column = camera.width // 2
    seen = expected <= 4.0
    np.testing.assert_allclose(camera.depth[seen, column], expected[seen], rtol=1e-5)
    assert np.all(camera.depth[~seen, column] == camera.far)
    below = picture(scene_of((floor, ((0.0, 0.0, 1.0), HERE[1]))))
    assert np.all(below.depth == below.far)


@pytest.mark.parametrize("kind", [layout.BOX, layout.SPHERE, layout.CYLINDER])
def test_camera_inside_of_a_shape_sees_through_it(kind):
    camera = picture(scene_of((Part(kind, (1.0, 1.0, 1.0), RED), HERE),
                              (Part(layout.BOX, (0.5, 9.0, 9.0), GREEN), ((5.0, 0.0, 0.0), HERE[1]))))
    assert np.all(camera.depth == np.float32(4.5)) and np.all(camera.colour == (0, 102, 0))


def test_nearer_shapes_hide_others_whatever_the_order():
    near = Part(layout.BOX, (0.1, 0.2, 0.2), RED), ((2.0, 0.0, 0.0), HERE[1])
    wall = Part(layout.BOX, (0.1, 9.0, 9.0), GREEN), ((4.0, 0.0, 0.0), HERE[1])
    for parts in ((near, wall), (wall, near)):
        camera = picture(scene_of(*parts))
        assert tuple(camera.colour[60, 80]) == (102, 0, 0) and tuple(camera.colour[5, 5]) == (0, 102, 0)


def test_nothing_is_seen_outside_of_the_limits():
    parts = [(Part(layout.SPHERE, (0.1,) * 3, RED), ((x, 0.0, 0.0), HERE[1])) for x in (0.5, 20.0)]
    camera = picture(scene_of(*parts), 32, 24, near=1.0, far=15.0)
    assert np.all(camera.depth == 15.0) and np.all(camera.colour == BACKGROUND)


def test_culling_by_the_tree_changes_no_pixel():
    rng = np.random.default_rng(5)
    parts = [(Part([layout.BOX, layout.SPHERE, layout.CYLINDER][k % 3], (0.3, 0.3, 0.3 + 0.3 * (k % 3 != 1)),
                   tuple(rng.uniform(0, 1, 3))),
              (tuple(rng.uniform((1, -6, -1), (15, 6, 1))), quaternion_from_rpy(*rng.uniform(-3, 3, 3))))
             for k in range(150)]
    scene, camera = scene_of(*parts), Camera(160, 120, 1.2, 0.1, 50.0)
    camera.take(scene)
    single = np.full(camera.depth.shape, camera.far, np.float32)
    for part in parts:
        single = np.minimum(single, picture(scene_of(part)).depth)
    np.testing.assert_array_equal(camera.depth, single)
    moving = picture(scene_of(*parts, moving=True))
    np.testing.assert_array_equal(camera.depth, moving.depth)
    np.testing.assert_array_equal(camera.colour, moving.colour)


def test_hidden_obstacles_cost_no_visits_of_the_tree():
    wall = Part(layout.BOX, (0.1, 99.0, 99.0), GREEN), ((2.0, 0.0, 0.0), HERE[1])
    visits = []
    for count in (100, 10000):
        rng = np.random.default_rng(0)
        places = rng.uniform((3, -20, -2), (45, 20, 2), (count, 3))
        parts = [wall] + [(Part(layout.SPHERE, (0.2,) * 3, RED), (tuple(place), HERE[1])) for place in places]
        camera = picture(scene_of(*parts))
        assert np.all(camera.depth == np.float32(1.9))
        visits.append(camera.visits)
    assert visits[1] <= 3 * visits[0] + 60


# ---- light -----------------------------------------------------------------------------------------------------


def sun(x, y, z, shadow=1.0, strength=0.6):
    length = math.sqrt(x * x + y * y + z * z)
    return [1.0, x / length, y / length, z / length, strength, strength, strength, 1.0, 0.0, 0.0, shadow]


def test_brightness_follows_the_cosine_of_the_angle_to_the_light():
    wall = Part(layout.BOX, (0.1, 9.0, 9.0), WHITE), ((2.0, 0.0, 0.0), HERE[1])
    for angle in (0.0, 0.5, 1.2, 2.0):
        camera = picture(scene_of(wall, lights=[sun(-math.cos(angle), math.sin(angle), 0.0)]), 16, 12)
        assert np.all(np.abs(camera.colour - 255 * (0.4 + 0.6 * max(0.0, math.cos(angle)))) <= 1)


@pytest.mark.parametrize("kind", ["box", "mesh", "moving box"])
def test_shadow_of_a_box_on_the_floor_has_the_projected_outline(kind):
    floor = Part(layout.PLANE, (50.0, 50.0, 0.0), WHITE), ((0.0, 0.0, -2.0), HERE[1])
    down = ((0.0, 0.0, 3.0), quaternion_from_rpy(0.0, 0.5 * math.pi, 0.0))
    half, where = (0.5, 0.5, 0.1), ((0.0, 0.0, 0.0), HERE[1])
    scene = scene_of(floor, lights=[sun(0.0, 1.0, 1.0)])
    part = Part(layout.MESH, surface_of_box(half), RED) if kind == "mesh" else Part(layout.BOX, half, RED)
    scene.add_all([part], [where], "caster", kind == "moving box")
    camera = picture(scene, 240, 240, 1.2, down)
    # by 45 degrees along y: lower side at z -0.1 is shifted by 1.9, upper side at 0.1 by 2.1
    shadow = [(x, y, -2.0) for x in (-0.5, 0.5) for y in (-2.6, -1.4)]
    places = pixels_of(camera, shadow, down)
    inside = np.zeros((240, 240), bool)
    low, high = np.ceil(places[:, :2].min(axis=0)).astype(int), np.floor(places[:, :2].max(axis=0)).astype(int)
    inside[low[1]:high[1] + 1, low[0]:high[0] + 1] = True
    dark = (camera.colour[:, :, 1] > 0) & (camera.colour[:, :, 1] < 140)
    assert inside.sum() > 300 and (dark != inside).sum() <= 6


def test_without_cast_shadows_there_is_none():
    floor = Part(layout.PLANE, (50.0, 50.0, 0.0), WHITE), ((0.0, 0.0, -2.0), HERE[1])
    box = Part(layout.BOX, (0.5, 0.5, 0.1), RED, None, (1.0, 1.0), False), HERE
    down = ((0.0, 0.0, 3.0), quaternion_from_rpy(0.0, 0.5 * math.pi, 0.0))
    for parts, light in (((floor, box), sun(0.0, 1.0, 1.0)),
                         ((floor, (Part(layout.BOX, (0.5, 0.5, 0.1), RED), HERE)), sun(0.0, 1.0, 1.0, 0.0))):
        colour = picture(scene_of(*parts, lights=[light]), 120, 120, 1.2, down).colour
        assert set(colour[colour[:, :, 1] > 0][:, 1]) == {colour[0, 0, 1]}


def test_point_light_fades_with_distance():
    wall = Part(layout.BOX, (0.1, 9.0, 9.0), WHITE), ((2.1, 0.0, 0.0), HERE[1])
    light = [0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.5, 0.0, 1.0, 0.0, 0.0]
    camera = picture(scene_of(wall, lights=[light]), 161, 121)
    assert abs(int(camera.colour[60, 80, 0]) - 255 * (0.4 + 0.25)) <= 1
    assert camera.colour[0, 0, 0] < camera.colour[60, 80, 0]


# ---- textures --------------------------------------------------------------------------------------------------


def quarters():
    """Red and green above, blue and white below."""
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:32, :32], pixels[:32, 32:] = (255, 0, 0), (0, 255, 0)
    pixels[32:, :32], pixels[32:, 32:] = (0, 0, 255), (255, 255, 255)
    return Texture(pixels)


def corners_in(colour):
    height, width = colour.shape[:2]
    return [tuple((colour[j, i] > 50).astype(int)) for j in (height // 4, 3 * height // 4)
            for i in (width // 4, 3 * width // 4)]


UPRIGHT = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)]


def test_texture_on_the_floor_is_upright_seen_from_above():
    floor = Part(layout.PLANE, (1.0, 1.0, 0.0), WHITE, quarters()), HERE
    pose = ((0.0, 0.0, 2.0), compose((HERE[0], quaternion_from_rpy(0.0, 0.0, 0.5 * math.pi)),
                                     (HERE[0], quaternion_from_rpy(0.0, 0.5 * math.pi, 0.0)))[1])
    assert corners_in(picture(scene_of(floor), 64, 64, 0.9, pose).colour) == UPRIGHT


@pytest.mark.parametrize("yaw", [0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi])
def test_texture_on_each_side_of_a_box_is_upright(yaw):
    box = Part(layout.BOX, (1.0, 1.0, 1.0), WHITE, quarters()), ((3.0, 0.0, 0.0), quaternion_from_rpy(0.0, 0.0, yaw))
    assert corners_in(picture(scene_of(box), 64, 64, 0.9).colour) == UPRIGHT


def test_texture_of_a_mesh_follows_its_coordinates():
    corners = np.array((((3.0, 1.0, -1.0), (3.0, -1.0, -1.0), (3.0, -1.0, 1.0)),
                        ((3.0, 1.0, -1.0), (3.0, -1.0, 1.0), (3.0, 1.0, 1.0))))[:, ::-1]
    uv = np.array((((0.0, 1.0), (1.0, 1.0), (1.0, 0.0)), ((0.0, 1.0), (1.0, 0.0), (0.0, 0.0))))[:, ::-1]
    normal = np.cross(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0])
    if normal[0] > 0:
        corners, uv = corners[:, ::-1], uv[:, ::-1]
    surface = Surface(corners, np.ones((2, 3)), uv, (quarters(),), np.zeros(2, np.int64))
    assert corners_in(picture(scene_of((Part(layout.MESH, surface), HERE)), 64, 64, 0.65).colour) == UPRIGHT


def test_distant_texture_is_averaged():
    stripes = np.zeros((256, 256, 3), np.uint8)
    stripes[:, ::2] = 255
    wall = Part(layout.BOX, (0.1, 1.0, 1.0), WHITE, Texture(stripes)), ((10.0, 0.0, 0.0), HERE[1])
    colour = picture(scene_of(wall), 64, 48, 1.0).colour
    seen = colour[22:26, 30:34]
    assert np.all(np.abs(seen.astype(int) - 0.4 * 128) < 12)


# ---- limits ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("values, word", [
    ((0, 240, 1.0, 0.1, 100.0), "image width 0: expected 1 to 8192 pixels"),
    ((320, 50000, 1.0, 0.1, 100.0), "image height 50000: expected 1 to 8192 pixels"),
    ((8000, 8000, 1.0, 0.1, 100.0), "expected at most 16777216 in all"),
    ((320, 240, 0.0, 0.1, 100.0), "horizontal_fov 0.0: expected 0.01 to 3.1 rad"),
    ((320, 240, math.pi, 0.1, 100.0), "horizontal_fov"),
    ((320, 240, math.nan, 0.1, 100.0), "horizontal_fov"),
    ((320, 240, 1.0, 5.0, 1.0), "clip near 5.0, far 1.0: expected 0 < near < far"),
    ((320, 240, 1.0, 0.0, 1.0), "clip near"),
    ((320, 240, 1.0, 0.1, math.inf), "clip near"),
])
def test_impossible_cameras_are_refused_with_their_limits(values, word):
    with pytest.raises(ValueError, match=word.replace("(", r"\(")):
        Camera(*values)


def test_camera_that_is_not_in_the_world_sees_nothing():
    scene = scene_of((Part(layout.BOX, (1.0, 1.0, 1.0), RED), ((3.0, 0.0, 0.0), HERE[1])))
    for pose in ((math.nan, 0.0, 0.0), (math.inf, 0.0, 0.0)):
        assert np.all(picture(scene, 16, 12, pose=(pose, HERE[1])).depth == 50.0)


def test_shape_without_a_finite_pose_hides_no_other():
    box = Part(layout.BOX, (0.5, 0.5, 0.5), RED)
    for moving in (False, True):
        scene = scene_of((box, ((math.nan, 0.0, 0.0), HERE[1])), (box, ((3.0, 0.0, 0.0), HERE[1])), moving=moving)
        camera = picture(scene)
        assert abs(camera.depth[60, 80] - 2.5) < 1e-6


def test_removed_shapes_are_gone_and_rows_are_used_again():
    scene = scene_of((Part(layout.BOX, (0.5, 0.5, 0.5), RED), ((3.0, 0.0, 0.0), HERE[1])))
    scene.remove_owner("all")
    assert np.all(picture(scene).depth == 50.0)
    assert scene.add_all([Part(layout.SPHERE, (0.5,) * 3, RED)], [((3.0, 0.0, 0.0), HERE[1])], "other", False) == [0]
    assert abs(picture(scene).depth[60, 80] - 2.5) < 1e-3
