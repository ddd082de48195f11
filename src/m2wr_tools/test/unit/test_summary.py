# SPDX-License-Identifier: BSD-3-Clause
"""The report on a run: synthetic bags with known answers, clearances in closed form, pixels of the picture."""
import math
import time

import matplotlib
import matplotlib.image
import numpy as np
import pytest
import rosbag
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped, PoseStamped
from matplotlib.colors import to_rgb
from nav_msgs.msg import Odometry, Path
from std_msgs.msg import String

from m2wr_sim.geometry import compose, quaternion_from_rpy
from m2wr_sim.model.outlines import obstacle_outlines, outlines_of
from m2wr_sim.model.types import Box, Cylinder, Plane, Sphere, Surface, World
from m2wr_tools.runs.summary import Summary, format_table, summarise
from m2wr_view import run_picture as picture
from m2wr_view.errors import ViewError
from m2wr_view.outlines import M2WR_FOOTPRINT, convex_hull, footprint_distances, least_clearance
from m2wr_view.run_log import RunLog, read_run

CENTRE = np.zeros((1, 3))


# ---- bags --------------------------------------------------------------------------------------------------------

class Recorder:
    """Writes a bag as `rosbag record --lz4` does; ``offset`` [s] puts the recorder's time ahead of simulated time."""

    def __init__(self, path, offset=0.0):
        self.path, self.bag, self.offset = str(path), rosbag.Bag(str(path), "w", "lz4"), offset

    def write(self, topic, message, now):
        if hasattr(message, "header"):
            message.header.stamp = rospy.Time.from_sec(now)
        self.bag.write(topic, message, rospy.Time.from_sec(now + self.offset))

    def pose(self, now, x, y, yaw=0.0):
        message = Odometry()
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        self.write("/odom", message, now)

    def state(self, now, name):
        self.write("/bug2/state", String(data=name), now)

    def point(self, now, kind, x, y):
        message = PointStamped()
        message.point.x, message.point.y = x, y
        self.write("/bug2/%s_point" % kind, message, now)

    def line(self, now, *ends):
        message = Path()
        for x, y in ends:
            message.poses.append(PoseStamped())
            message.poses[-1].pose.position.x, message.poses[-1].pose.position.y = x, y
        self.write("/bug2/m_line", message, now)

    def status(self, now, **values):
        pairs = [KeyValue(key.replace("_", " ").replace("real time", "real-time"), str(value))
                 for key, value in values.items()]
        other = DiagnosticStatus(name="other: thing", values=[KeyValue("touches of m2wr", "77")])
        self.write("/diagnostics", DiagnosticArray(status=[
            DiagnosticStatus(name="m2wr_sim: simulation", values=pairs), other]), now)

    def close(self):
        self.bag.close()
        return self.path


def record_corner(path, offset=0.0):
    """A spawn far away, a teleport, then 4 m east and 3 m north at 1 m/s; two state changes and the goal."""
    recorder = Recorder(path, offset)
    recorder.pose(0.5, 20.0, 20.0)
    recorder.state(1.001, "go_to_point")
    recorder.pose(1.0, 0.0, 0.0)
    recorder.line(1.001, (0.0, 0.0), (4.0, 3.0))
    for step in range(1, 401):
        recorder.pose(1.0 + 0.01 * step, 0.01 * step, 0.0)
    recorder.point(5.0, "hit", 4.0, 0.0)
    recorder.state(5.005, "wall_following")
    recorder.state(5.005, "wall_following")
    for step in range(1, 301):
        recorder.pose(5.0 + 0.01 * step, 4.0, 0.01 * step, math.pi / 2)
    recorder.point(7.0, "leave", 4.0, 2.0)
    recorder.state(7.005, "go_to_point")
    recorder.status(2.0, mean_real_time_factor=1.5)
    recorder.status(6.0, mean_real_time_factor=3.25, **{"touches of m2wr": 2}, real_time_factor=9.0)
    recorder.state(8.0, "goal_reached")
    recorder.pose(8.5, 4.0, 3.0, math.pi / 2)
    return recorder.close()


@pytest.mark.parametrize("offset", (0.0, 1.7e9), ids=("simulated", "wall"))
def test_run_is_read_in_simulated_time(tmp_path, offset):
    log = read_run(record_corner(tmp_path / "run.bag", offset))
    assert [name for _, name in log.states] == ["go_to_point", "wall_following", "go_to_point", "goal_reached"]
    # the recorder's times are only good to a microsecond where they count from 1970
    assert [when for when, _ in log.states] == pytest.approx([1.001, 5.005, 7.005, 8.0], abs=2e-6)
    assert log.times[0] == pytest.approx(1.01) and log.times[-1] == pytest.approx(8.5)
    assert (log.x[-1], log.y[-1]) == (4.0, 3.0) and log.yaw[-1] == pytest.approx(math.pi / 2)
    assert log.hit_points.tolist() == [[4.0, 0.0]] and log.leave_points.tolist() == [[4.0, 2.0]]
    assert log.start == (0.0, 0.0) and log.goal == (4.0, 3.0)
    assert log.contacts == 2 and log.mean_factor == 3.25


def test_summary_of_a_known_way(tmp_path, build):
    world = World(models=(build.ground(), build.box("crate", 2.0, 1.0, 0.25)))
    summary = summarise(read_run(record_corner(tmp_path / "run.bag")), world)
    assert summary.path_length == pytest.approx(3.99 + 3.0, abs=1e-9)       # from the first pose in a state
    assert summary.straight_distance == 5.0 and summary.end_distance == 0.0
    assert summary.duration == pytest.approx(8.0 - 1.01)
    assert summary.state_changes == 3 and summary.final_state == "goal_reached"
    assert summary.contacts == 2 and summary.mean_factor == 3.25
    # the wheel's outer side passes the crate's lower side: 0.75 - 0.22
    assert summary.least_clearance == pytest.approx(0.53, abs=1e-9) and summary.clearance_name == "crate"
    table = format_table(summary)
    assert "goal reached" in table and "6.99 m (1.40 times the straight line)" in table
    assert "0.530 m to crate" in table
    column = table.splitlines()[0].index("goal reached")
    assert all(line[column - 1] == " " != line[column] for line in table.splitlines())


def test_arguments_win_over_the_recorded_line(tmp_path):
    log = read_run(record_corner(tmp_path / "run.bag"), start=(1, 2), goal=(3, 4), robot="other")
    assert log.start == (1.0, 2.0) and log.goal == (3.0, 4.0) and log.contacts == 0


def test_being_moved_is_no_way(tmp_path):
    recorder = Recorder(tmp_path / "moved.bag")
    recorder.state(0.0, "go_to_point")
    for step in range(100):
        recorder.pose(0.1 * step, 0.05 * step, 0.0 if step < 50 else 7.0)
    log = read_run(recorder.close())
    assert len(log.times) == 50 and log.y.tolist() == [7.0] * 50
    assert summarise(log, World()).path_length == pytest.approx(49 * 0.05)


def test_only_what_follows_a_reset_is_read(tmp_path):
    recorder = Recorder(tmp_path / "reset.bag")
    recorder.state(0.0, "go_to_point")
    recorder.pose(0.0, 0.0, 0.0)
    recorder.state(1.0, "wall_following")
    recorder.point(1.0, "hit", 9.0, 9.0)
    recorder.pose(2.0, 0.3, 0.0)
    recorder.offset = 100.0         # the recorder's clock is ahead
    recorder.pose(0.0, 0.0, 0.0)
    recorder.state(0.0, "go_to_point")
    recorder.pose(1.0, 0.1, 0.0)
    recorder.state(1.0, "goal_reached")
    log = read_run(recorder.close())
    assert log.times.tolist() == [0.0, 1.0] and log.hit_points is None
    assert log.states == ((0.0, "go_to_point"), (1.0, "goal_reached"))


def test_what_was_not_recorded_is_none(tmp_path):
    recorder = Recorder(tmp_path / "states.bag")
    recorder.state(1.0, "go_to_point")
    log = read_run(recorder.close())
    assert log == RunLog(log.path, states=((1.0, "go_to_point"),))
    summary = summarise(log, World())
    assert summary.path_length is summary.least_clearance is summary.duration is summary.contacts is None
    assert format_table(summary).count("not recorded") == 7
    picture.draw_run(log, (), (), summary, tmp_path / "states.png")
    assert (tmp_path / "states.png").stat().st_size > 1000


def test_poses_without_states(tmp_path, build):
    recorder = Recorder(tmp_path / "poses.bag")
    recorder.pose(1.0, 0.0, 0.0)
    recorder.pose(2.0, 0.4, 0.0)
    log = read_run(recorder.close())
    summary = summarise(log, World(models=(build.ground(),)))
    assert summary.final_state is None and summary.state_changes is None and summary.duration == pytest.approx(1.0)
    assert summary.least_clearance == math.inf and "no obstacles" in format_table(summary)
    picture.draw_run(log, (), (), summary, tmp_path / "poses.png")


def message_of(path):
    with pytest.raises(ViewError) as caught:
        read_run(path)
    return str(caught.value)


def test_unusable_bags_are_named(tmp_path):
    good = record_corner(tmp_path / "good.bag")
    missing, text, empty, zero = (str(tmp_path / name) for name in ("no.bag", "text.bag", "empty.bag", "zero.bag"))
    (tmp_path / "text.bag").write_text("this is no bag\n")
    (tmp_path / "zero.bag").write_bytes(b"")
    Recorder(empty).close()
    (tmp_path / "killed.bag.active").write_bytes(b"#ROSBAG V2.0\n")
    for path, words in ((missing, "No such file"), (text, "not appear to be a bag"), (zero, "empty file"),
                        (empty, "no message"), (str(tmp_path), "directory"),
                        (str(tmp_path / "killed.bag.active"), "reindex"),
                        (str(tmp_path / "killed.bag"), "has not finished")):
        message = message_of(path)
        assert message.startswith("bag %s: " % path) and words in message and "expected" in message, message
    assert read_run(good).contacts == 2


def test_broken_bags_are_named(tmp_path):
    whole = open(record_corner(tmp_path / "good.bag"), "rb").read()
    broken = tmp_path / "broken.bag"
    for share in (0.01, 0.2, 0.5, 0.9, 0.999):
        broken.write_bytes(whole[:int(share * len(whole))])
        assert str(broken) in message_of(broken)
    noise = np.random.default_rng(1)
    refused = 0
    for _ in range(40):         # any byte may be wrong: either no error or one message
        data = bytearray(whole)
        for place in noise.integers(20, len(data), 30):
            data[place] = noise.integers(256)
        broken.write_bytes(bytes(data))
        try:
            read_run(broken)
        except ViewError as error:
            refused += 1
            assert str(broken) in str(error)
    assert refused > 20


def test_a_topic_of_another_type_is_named(tmp_path):
    recorder = Recorder(tmp_path / "odd.bag")
    recorder.write("/odom", String(data="here"), 1.0)
    message = message_of(recorder.close())
    assert "/odom" in message and "std_msgs/String" in message and "expected nav_msgs/Odometry" in message


def test_diagnostics_without_numbers_are_named(tmp_path):
    recorder = Recorder(tmp_path / "odd.bag")
    recorder.status(1.0, **{"touches of m2wr": "many"})
    assert '"many"' in message_of(recorder.close())


# ---- outlines ----------------------------------------------------------------------------------------------------

def test_footprint_is_that_of_the_model(m2wr, build):
    """The chassis stands 0.1 m above the floor; all of the model lies within the footprint, and fills it."""
    laid = obstacle_outlines(World(models=(m2wr.__class__("m2wr", m2wr.links, pose=build.at(z=0.1)),)))
    turns = np.linspace(0.0, 2.0 * math.pi, 721)
    rays = np.stack((np.cos(turns), np.sin(turns)))

    def support(outlines):
        return np.max([np.max(outline.vertices.dot(rays), axis=0) + outline.radius for outline in outlines], axis=0)

    assert np.allclose(support(laid), support(M2WR_FOOTPRINT), atol=1e-4)
    for part in M2WR_FOOTPRINT:
        assert min(np.max(np.abs(support([part]) - support([outline]))) for outline in laid) < 1e-4


def outline_of(*arguments, **keywords):
    """Return the only outline of a shape, or None."""
    found = outlines_of(*arguments, **keywords)
    assert len(found) < 2
    return found[0] if found else None


def test_hull_keeps_corners_only():
    points = [(0, 0), (2, 0), (1, 0), (2, 1), (0, 1), (1, 0.5), (0, 0)]
    assert convex_hull(points).tolist() == [[0, 0], [2, 0], [2, 1], [0, 1]]
    assert convex_hull([(1, 1), (1, 1)]).tolist() == [[1, 1]]


def test_only_what_is_at_the_robots_height_counts(build):
    pose = build.at(1.0, 2.0, 0.5)
    assert outline_of(Plane(), pose) is None
    assert outline_of(Box((1, 1, 0.58)), pose) is None                       # from 0.21 m up
    assert outline_of(Box((50, 50, 0.2)), build.at(z=-0.1)) is None          # the floor itself
    assert outline_of(Cylinder(0.3, 0.58), pose) is None
    assert outline_of(Sphere(0.29), pose) is None
    ball = outline_of(Sphere(0.5), pose)                                     # cut 0.3 m below its centre
    assert ball.radius == pytest.approx(0.4) and ball.vertices.tolist() == [[1.0, 2.0]]
    assert outline_of(Cylinder(0.3, 1.0), pose).radius == 0.3
    assert outline_of(Box((1, 1, 0.62)), pose).vertices.shape == (4, 2)


def test_tilted_plate_is_cut_at_the_robots_height():
    """A thin plate that rises at 30 degrees from the floor: seen from above, what is below 0.2 m ends at 0.2 / tan."""
    tilt = math.radians(30.0)
    pose = compose(((0.0, 0.0, 0.0), quaternion_from_rpy(0.0, -tilt, 0.0)), ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    x = outline_of(Box((2.0, 0.6, 1e-6)), pose, low=0.0).vertices[:, 0]
    assert x.min() == pytest.approx(0.0, abs=1e-5) and x.max() == pytest.approx(0.2 / math.tan(tilt), abs=1e-5)


def test_lying_cylinder_is_a_rectangle(build):
    pose = ((0.0, 0.0, 0.1), quaternion_from_rpy(math.pi / 2, 0.0, 0.0))
    vertices = outline_of(Cylinder(0.1, 2.0), pose).vertices
    assert vertices.min(axis=0) == pytest.approx((-0.1, -1.0), abs=1e-4)
    assert vertices.max(axis=0) == pytest.approx((0.1, 1.0), abs=1e-4)


def test_what_does_not_collide_is_no_obstacle(build):
    ghost = build.one_link("ghost", Box((1, 1, 1)), build.at(z=0.5), surface=Surface(collide_bitmask=0))
    sensor = build.one_link("sensor", Box((1, 1, 1)), build.at(z=0.5), surface=Surface(collide_without_contact=True))
    solid = build.box("solid", 3.0, 0.0, 0.25)
    assert [outline.name for outline in obstacle_outlines(World(models=(ghost, sensor, solid)))] == ["solid"]


# ---- clearance ---------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("geometry, pose, expected", [
    (Box((1.0, 1.0, 1.0)), (2.0, 0.0, 0.0), 1.5 - 0.40),                     # ahead: the caster's tip
    (Box((1.0, 1.0, 1.0)), (-2.0, 0.0, 0.0), 1.5 - 0.25),                    # behind: the chassis
    (Box((1.0, 1.0, 1.0)), (0.0, 2.0, 0.0), 1.5 - 0.22),                     # left: the wheel
    (Box((1.0, 1.0, 1.0)), (2.0, 0.0, math.pi / 4), 2.0 - math.sqrt(0.5) - 0.40),
    (Box((1.0, 1.0, 1.0)), (1.25, 1.15, 0.0), math.hypot(0.5, 0.5)),         # corner to the chassis' corner
    (Cylinder(0.3, 1.0), (0.65, 0.55, 0.0), math.hypot(0.4, 0.4) - 0.3),
    (Cylinder(0.3, 1.0), (1.0, 0.0, 0.0), 1.0 - 0.3 - 0.40),
    (Box((0.02, 5.0, 1.0)), (0.0, 0.0, 0.3), 0.0),                           # a bar across: no corner lies inside
    (Cylinder(0.05, 1.0), (0.0, 0.0, 0.0), 0.0),                             # inside the chassis
    (Box((0.08, 0.02, 1.0)), (-0.05, 0.165, 0.0), 0.005),                    # in the gap between wheel and chassis
])
def test_clearance_in_closed_form(build, geometry, pose, expected):
    x, y, yaw = pose
    obstacle = outline_of(geometry, build.at(x, y, 0.5, yaw))
    assert footprint_distances(CENTRE, obstacle)[0] == pytest.approx(expected, abs=1e-9)
    # the same seen from elsewhere
    turn = 2.1
    moved = compose(build.at(3.0, -1.0, 0.0, turn), build.at(x, y, 0.5, yaw))
    assert footprint_distances(np.array([(3.0, -1.0, turn)]), outline_of(geometry, moved))[0] \
        == pytest.approx(expected, abs=1e-9)


def test_least_clearance_agrees_with_every_pair_looked_at(build):
    """The search skips most pairs; the answer is that of all of them."""
    random = np.random.default_rng(5)
    shapes = []
    for number in range(60):
        x, y, yaw = random.uniform((-9, -9, 0), (9, 9, 6))
        geometry = (Box(tuple(random.uniform(0.1, 3.0, 2)) + (1.0,)), Cylinder(random.uniform(0.05, 0.6), 1.0),
                    Sphere(random.uniform(0.1, 0.5)))[number % 3]
        shapes.append(outline_of(geometry, build.at(x, y, 0.2, yaw), name=str(number)))
    for _ in range(5):
        poses = random.uniform((-9, -9, -3), (9, 9, 3), (40, 3))
        table = np.array([footprint_distances(poses, shape) for shape in shapes])
        apart = np.flatnonzero(table.min(axis=0) > 0.0)
        found = least_clearance(poses[apart], shapes)
        assert found.distance == table[:, apart].min() > 0.0
        assert table[int(found.name), apart[found.index]] == found.distance


def test_clearance_against_a_dense_sampling_of_the_border(build):
    """An independent answer: the least distance between points laid along both borders."""
    random = np.random.default_rng(8)

    def border(outline):
        if len(outline.vertices) == 1:
            turns = np.linspace(0, 2 * math.pi, 600)
            return outline.vertices + outline.radius * np.stack((np.cos(turns), np.sin(turns)), axis=1)
        ends = np.roll(outline.vertices, -1, axis=0)
        return np.concatenate([a + np.linspace(0, 1, 150)[:, None] * (b - a) for a, b in zip(outline.vertices, ends)])

    for _ in range(15):
        x, y, yaw = random.uniform((0.8, -1.5, 0), (1.5, 1.5, 6))
        obstacle = outline_of(Box((0.5, 0.2, 1.0)), build.at(x, y, 0.5, yaw))
        there = border(obstacle)
        sampled = min(np.min(np.hypot(*(border(part)[:, None] - there[None]).transpose(2, 0, 1)))
                      for part in M2WR_FOOTPRINT)
        assert footprint_distances(CENTRE, obstacle)[0] == pytest.approx(sampled, abs=1e-3)


def test_clearance_of_a_long_run_is_quick(build):
    random = np.random.default_rng(3)
    models = [build.box("box", *random.uniform((-9, -9, 0.2), (9, 9, 0.3)), size=(0.4, 0.2, 0.5)) for _ in range(200)]
    turns = np.linspace(0.0, 20.0, 3000)
    poses = np.column_stack((0.4 * turns * np.cos(turns), 0.4 * turns * np.sin(turns), turns))
    outlines = obstacle_outlines(World(models=tuple(models)))
    began = time.process_time()
    least_clearance(poses, outlines)
    assert time.process_time() - began < 2.0


def outlines(world):
    return obstacle_outlines(world), obstacle_outlines(world, high=math.inf)


# ---- picture -----------------------------------------------------------------------------------------------------

@pytest.fixture
def drawn(tmp_path, build):
    """Draw the corner run past a crate; returns a function from a point in metres to the colour of its pixel."""
    world = World(models=(build.ground(), build.box("crate", 2.0, 1.5, 0.25, size=(1.0, 1.0, 0.5)),
                          build.one_link("shelf", Box((1.0, 1.0, 0.1)), build.at(1.0, 4.5, 1.0))))
    log = read_run(record_corner(tmp_path / "run.bag"))
    summary = summarise(log, world)
    backend = dict.__getitem__(matplotlib.rcParams, "backend")      # the plain [] would choose one
    picture.draw_run(log, *outlines(world), summary, tmp_path / "run.png")
    assert dict.__getitem__(matplotlib.rcParams, "backend") is backend
    image = matplotlib.image.imread(str(tmp_path / "run.png"))[..., :3]
    axes = picture.run_figure(log, *outlines(world), summary).axes[0]

    def colour(x, y):
        column, row = axes.transData.transform((x, y))
        return tuple(image[image.shape[0] - 1 - int(row), int(column)])

    colour.image, colour.axes = image, axes
    return colour


def test_picture_has_its_colours_where_they_belong(drawn):
    assert drawn.image.shape[:2] == (1080, 1000)
    near = dict(abs=0.02)
    assert drawn(4.0, 3.0) == pytest.approx(to_rgb(picture.GOAL_COLOUR), **near)
    assert drawn(0.0, 0.0) == pytest.approx(to_rgb(picture.START_COLOUR), **near)
    assert drawn(4.0, 0.0) == pytest.approx(to_rgb(picture.HIT_COLOUR), **near)
    assert drawn(4.0, 2.0) == pytest.approx(to_rgb(picture.LEAVE_COLOUR), **near)
    assert drawn(1.5, 0.0) == pytest.approx(to_rgb(picture.STATE_COLOURS["go_to_point"]), **near)
    assert drawn(4.0, 1.2) == pytest.approx(to_rgb(picture.STATE_COLOURS["wall_following"]), **near)
    for x, y in ((1.55, 1.05), (2.45, 1.95), (1.55, 1.95)):
        assert drawn(x, y) == pytest.approx(to_rgb(picture.OBSTACLE_COLOUR), **near)
    assert drawn(1.1, 4.4) == pytest.approx(to_rgb(picture.OVERHANG_COLOUR), **near)
    assert drawn(2.56, 1.53) == (1.0, 1.0, 1.0)          # just beside the crate


def test_picture_is_to_scale(drawn):
    (x0, y0), (x1, y1) = drawn.axes.transData.transform([(0.0, 0.0), (1.0, 1.0)])
    assert x1 - x0 == pytest.approx(y1 - y0, rel=1e-3) and x1 - x0 > 50.0
    title = drawn.axes.get_title()
    assert title.startswith("goal reached after 7.0 s") and "2 contacts" in title
    labels = [text.get_text() for text in drawn.axes.figure.legends[0].get_texts()]
    assert labels == ["obstacle", "go to point", "wall following", "m-line", "robot, every 10 s", "start (0, 0)",
                      "goal (4, 3)", "hit point", "leave point"]


def test_picture_that_cannot_be_written_is_named(tmp_path):
    path = tmp_path / "no_folder" / "run.png"
    with pytest.raises(ViewError, match="picture .*run.png: No such file"):
        picture.draw_run(RunLog("x.bag"), (), (), Summary(*[None] * 7, "", *[None] * 4), path)
