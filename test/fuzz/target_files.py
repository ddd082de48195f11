# SPDX-License-Identifier: BSD-3-Clause
"""Files of other kinds: meshes, pictures with heights, saved maps, recorded bags, tours."""
import io
import os
import struct
import tempfile

import mutations
from harness import Target, Wrong
from target_documents import corpus

_MESH_MODEL = """<sdf version="1.6"><model name="m"><static>1</static><link name="l"><collision name="c"><geometry>
%s</geometry></collision></link></model></sdf>"""


def scratch():
    """Return this process's own folder below that of the run."""
    folder = os.path.join(os.environ.get("M2WR_FUZZ_SCRATCH", tempfile.gettempdir()), "m2wr_fuzz_%d" % os.getpid())
    os.makedirs(folder, exist_ok=True)
    return folder


def written(name, data):
    """Write bytes into a file of the scratch folder; returns its path.

    Raises
    ------
    ValueError
        If the name points outside that folder: a case may come from another person's file.
    """
    if name != os.path.basename(name):
        raise ValueError("%r is not a file name; expected one without folders" % name)
    path = os.path.join(scratch(), name)
    with open(path, "wb") as stream:
        stream.write(data)
    return path


def pixels(mode="L", side=9, kind="PNG"):
    """Return the bytes of a small picture."""
    from PIL import Image
    image = Image.new(mode, (side, side))
    image.putdata([(7 * k) % 256 * (200 if mode == "I;16" else 1) for k in range(side * side)])
    buffer = io.BytesIO()
    image.save(buffer, kind)
    return buffer.getvalue()


class _Shape(Target):
    """A file that becomes a collision shape; a ball falls onto the shape, and a ray is cast at it."""

    cpu = 2.0

    def prepare(self):
        import worlds
        from m2wr_sim.errors import SimError
        from m2wr_sim.model.sdf.loader import load_sdf
        from m2wr_sim.model.urdf.loader import load_urdf
        from m2wr_sim.ros.gazebo_services.spawning import prepare
        from m2wr_sim.warm_up import warm_up
        warm_up("auto")
        self.worlds, self.foreseen, self.load_sdf, self.make_ready = worlds, (SimError,), load_sdf, prepare
        self.robot = load_urdf(corpus("drive.urdf")[0], source="drive.urdf")

    def put_in(self, geometry):
        models, _ = self.load_sdf(_MESH_MODEL % geometry, source="case.sdf")
        simulator = self.worlds.make_simulator()
        try:
            for model in models:
                kept = self.make_ready(model)
                try:
                    simulator.spawn(model, self.worlds.upright(0.0, 0.0, 0.0), "shape")
                except self.foreseen:
                    return
                del kept
            simulator.spawn(self.robot, self.worlds.upright(0.3, 0.3, 1.0), "cart", "/")
            self.worlds.run(simulator, 60)
        finally:
            simulator.close()


class MeshFile(_Shape):
    """STL in text and binary, OBJ, COLLADA."""

    name, weight = "mesh", 2.0

    def prepare(self):
        super().prepare()
        self.plain = {"obj": corpus("*.obj"), "stl": corpus("*.stl")}
        self.trees = mutations.Trees([text.partition("?>")[2] for text in corpus("*.dae")])
        facet = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
        self.binary = [b"binary".ljust(80) + struct.pack("<I", 4) + 4 * facet]

    def make(self, rng):
        kind = rng.choice(("obj", "stl", "dae", "binary"))
        if kind == "binary":
            return "stl", mutations.change_bytes(rng, self.binary[0], self.binary)
        if kind == "dae":
            return "dae", self.trees.change(rng).encode("utf-8", "replace")
        text = rng.choice(self.plain[kind])
        if rng.randrange(4):
            return kind, mutations.change_text(rng, text).encode("utf-8", "replace")
        return kind, mutations.change_bytes(rng, text.encode(), [other.encode() for other in self.plain[kind]])

    def smaller(self, case):
        return ((case[0], data) for data in mutations.smaller_sequences(case[1]))

    def describe(self, case):
        return case[1]

    def run(self, case):
        path = written("case." + case[0], case[1])
        try:
            self.put_in("<mesh><uri>file://%s</uri></mesh>" % path)
        except self.foreseen:
            pass


class HeightFile(_Shape):
    """Pictures with heights."""

    name = "heights"
    # a map at the limit of 2 000 000 triangles takes 3 s and 430 MB, most of it for the tree of its rays
    cpu, memory = 6.0, 600 * 2 ** 20

    def prepare(self):
        super().prepare()
        self.pictures = [pixels("L"), pixels("I;16"), pixels("RGB"), pixels("L", 9, "PPM"), pixels("L", 17, "TIFF"),
                         pixels("L", 9, "BMP"), pixels("L", 9, "GIF"), pixels("L", 9, "JPEG")]

    def make(self, rng):
        return mutations.change_bytes(rng, rng.choice(self.pictures), self.pictures)

    def run(self, case):
        path = written("heights.png", case)
        try:
            self.put_in("<heightmap><uri>file://%s</uri><size>4 4 1</size></heightmap>" % path)
        except self.foreseen:
            pass


class MapFiles(Target):
    """A map's YAML and its picture, as read by each program that uses maps."""

    name, cpu = "map", 2.0

    def prepare(self):
        from m2wr_maps import saved_map_reader
        from m2wr_sim.errors import SimError
        from m2wr_tools.map_comparison import command as compare_map
        self.readers = (saved_map_reader.read_map, compare_map.read_saved)
        self.foreseen = (saved_map_reader.MapReadingError, SimError)
        try:
            from map_pictures import files
            self.readers, self.foreseen = self.readers + (files.read_map,), self.foreseen + (files.MapError,)
        except ImportError:             # the real map_server is installed
            pass
        self.texts = corpus("*.yaml")
        head = b"P5\n# CREATOR: map_saver 0.050 m/pix\n8 6\n255\n"
        self.pictures = [head + bytes((0, 254, 205, 254, 0, 0, 205, 254) * 6), b"P2\n3 2\n255\n0 254 205\n254 0 0\n",
                         pixels("L"), pixels("RGB"), pixels("L", 300, "PNG")]

    def make(self, rng):
        text, picture = self.texts[0].encode(), self.pictures[0]
        kind = rng.randrange(3)
        if kind != 1:
            changed = mutations.change_text(rng, self.texts[0])
            text = changed.encode("utf-8", "replace") if rng.randrange(4) else mutations.change_bytes(rng, text)
        if kind != 0:
            picture = mutations.change_bytes(rng, rng.choice(self.pictures), self.pictures)
        if rng.randrange(50) == 0:
            text = b"a: " + rng.choice((b"[", b"{", b"- ", b"? ")) * rng.choice((50, 3000))
        if rng.randrange(50) == 0:
            text = b"&a [*a, *a]\nimage: &b [" + b"*b," * 30
        return text, picture

    def smaller(self, case):
        for text in mutations.smaller_sequences(case[0]):
            yield text, case[1]
        for picture in mutations.smaller_sequences(case[1]):
            yield case[0], picture

    def describe(self, case):
        return case[0] + b"\n---- room.pgm ----\n" + case[1]

    def run(self, case):
        path = written("room.yaml", case[0])
        written("room.pgm", case[1])
        for reader in self.readers:
            try:
                found = reader(path)
            except self.foreseen:
                continue
            data = found[0] if isinstance(found, tuple) else found.data
            if data.ndim != 2 or data.dtype.name != "int8":
                raise Wrong("%s gives cells of shape %s" % (reader.__module__, data.shape))


def make_bag(messages, compression="none"):
    """Return the bytes of a bag with (topic, message, time) in it."""
    import rosbag
    path = os.path.join(scratch(), "made.bag")
    with rosbag.Bag(path, "w", compression=compression, chunk_threshold=2000) as bag:
        for topic, message, stamp in messages:
            bag.write(topic, message, stamp)
    with open(path, "rb") as stream:
        return stream.read()


def drive_messages():
    """Return a few seconds of a robot with a laser: (topic, message, time)."""
    import rospy
    from geometry_msgs.msg import TransformStamped
    from nav_msgs.msg import Odometry
    from rosgraph_msgs.msg import Clock
    from sensor_msgs.msg import LaserScan
    from tf2_msgs.msg import TFMessage

    def transform(parent, child, stamp, x):
        made = TransformStamped(child_frame_id=child)
        made.header.frame_id, made.header.stamp = parent, stamp
        made.transform.translation.x, made.transform.rotation.w = x, 1.0
        return made

    found = []
    for k in range(12):
        stamp = rospy.Time(10, 0) + rospy.Duration(k * 0.25)
        x = 0.3 * k
        found.append(("/clock", Clock(stamp), stamp))
        found.append(("/tf", TFMessage([transform("odom", "base_link", stamp, x),
                                        transform("base_link", "laser", stamp, 0.2)]), stamp))
        odometry = Odometry(child_frame_id="base_link")
        odometry.header.stamp, odometry.header.frame_id = stamp, "odom"
        odometry.pose.pose.position.x, odometry.pose.pose.orientation.w = x, 1.0
        found.append(("/odom", odometry, stamp))
        scan = LaserScan(angle_min=-1.5, angle_max=1.5, angle_increment=0.1, range_min=0.1, range_max=8.0)
        scan.header.stamp, scan.header.frame_id = stamp, "laser"
        scan.ranges = [max(0.2, 4.0 - x) if i % 7 else 2.0 for i in range(31)]
        found.append(("/scan", scan, stamp))
    return found


class BagFiles(Target):
    """Bags, as read by the report, the pictures, and the mapper's replay, which makes a map."""

    name, cpu, weight = "bag", 4.0, 1.5

    def prepare(self):
        from m2wr_gmapping.config import GmappingConfig
        from m2wr_gmapping.kernel_warm_up import compile_kernels
        from m2wr_gmapping.replay import bag_messages, replay_command
        from m2wr_tools.runs import bag_report
        from m2wr_view.errors import ViewError
        self.bags = [make_bag(drive_messages(), kind) for kind in ("none", "bz2", "lz4")]
        config = GmappingConfig.from_mapping(dict(particles=3, threads=1, linearUpdate=0.2, base_frame="base_link",
                                                  xmin=-5.0, ymin=-5.0, xmax=5.0, ymax=5.0))
        self.config, self.command, self.bag_file, self.report = config, replay_command, bag_messages, bag_report.report
        self.options, _ = replay_command.parse(["--bag_filename", "x", "--quiet"])
        self.foreseen = (ViewError, bag_messages.BagError)
        compile_kernels()

    def make(self, rng):
        return mutations.change_bytes(rng, rng.choice(self.bags), self.bags)

    def run(self, case):
        path = written("case.bag", case)
        try:
            self.report(path)
        except self.foreseen:
            pass
        try:
            with self.bag_file.BagFile(path) as bag:
                replay = self.command.Replay(bag, self.options, self.config)
                self.replay(replay)
        except self.foreseen:
            pass

    @staticmethod
    def replay(replay):
        """Run a replay and check its path."""
        import numpy as np
        try:
            replay.run()
            if replay.mapper is not None and replay.mapper.filter is not None:
                _, poses = replay.mapper.trajectory()
                if not np.isfinite(poses).all():
                    raise Wrong("the path is not finite")
        finally:
            if replay.mapper is not None:
                replay.mapper.close()


class TourFile(Target):
    """Tours, as read by a launch file's rosparam, and driven for some control periods."""

    name, weight = "tour", 0.3

    def prepare(self):
        import yaml

        from motion_plan.tour import Tour, TourError
        self.yaml, self.tour, self.foreseen = yaml, Tour, (TourError, yaml.YAMLError)
        self.text = corpus("*.tour")[0]

    def make(self, rng):
        return mutations.change_text(rng, self.text)

    def run(self, case):
        import math
        try:
            values = self.yaml.safe_load(case)
        except (self.yaml.YAMLError, ValueError, RecursionError, OverflowError):
            return                  # rosparam's own reader, before code of this workspace
        if not isinstance(values, dict):
            return
        try:
            tour = self.tour(values.get("way_points"), values.get("speed", 0.5))
        except self.foreseen:
            return
        for turn in range(30):
            command = tour.update(float(turn), (math.sin(turn), math.cos(turn), turn % 3.0))
            if not all(map(math.isfinite, command)):
                raise Wrong("command %s" % (command,))
