# SPDX-License-Identifier: BSD-3-Clause
"""Input of the mapper and the controllers: scans, transforms and saved states."""
import copy
import io
import math

import mutations
from harness import Target, Wrong
from messages import Filler
from target_files import BagFiles, drive_messages, written

_FRAMES = ("", "odom", "base_link", "laser", "/laser", "map", "elsewhere")


class _Memory:
    """A list of messages with the interface of a bag."""

    fraction, damage = 1.0, None

    def __init__(self, messages):
        from m2wr_gmapping.replay.bag_messages import Message
        self.topics = {topic: kind for topic, kind, _ in messages}
        self._messages = [Message(*entry) for entry in messages]

    def messages(self, wanted):
        """Yield the messages of the ``wanted`` topics."""
        return (message for message in self._messages if wanted(message.topic))


class Scans(BagFiles):
    """Scans and transforms with extreme fields, in and out of order, to the mapper and to the motion planner."""

    name, cpu, weight = "scans", 4.0, 3.0

    def prepare(self):
        super().prepare()
        from motion_plan.obstacle_avoidance import ObstacleAvoidance
        from motion_plan.regions import RegionReader, ScanError
        from motion_plan.wall_follower import WallFollower
        self.planners, self.region_reader, self.scan_error = (ObstacleAvoidance, WallFollower), RegionReader, ScanError
        self.drive = [(topic, message) for topic, message, _ in drive_messages() if topic in ("/tf", "/scan")]

    def make(self, rng):
        case = []
        for topic, message in self.drive:
            buffer = io.BytesIO()
            message.serialize(buffer)
            case.append((topic, message._type, buffer.getvalue()))
        filler = Filler(lambda _: _FRAMES, 0.15)
        for _ in range(1 + rng.randrange(5)):
            at, kind = rng.randrange(len(case)), rng.randrange(6)
            if kind == 0:
                case.insert(rng.randrange(len(case)), case[at])
            elif kind == 1 and len(case) > 2:
                del case[at]
            elif kind == 2:
                topic, name, data = case[at]
                case[at] = topic, name, mutations.change_bytes(rng, data)
            else:
                topic, message = self.drive[at % len(self.drive)]
                fresh = type(message)()
                buffer = io.BytesIO()
                message.serialize(buffer)
                fresh.deserialize(buffer.getvalue())
                target = fresh.transforms[rng.randrange(2)] if topic == "/tf" else fresh
                filler._one_extreme(rng, target)
                if rng.randrange(8) == 0:
                    filler.fill(rng, target)
                buffer = io.BytesIO()
                fresh.serialize(buffer)
                case[at % len(case)] = topic, message._type, buffer.getvalue()
        return case

    def describe(self, case):
        return repr(case).encode()

    def run(self, case):
        from sensor_msgs.msg import LaserScan
        replay = self.command.Replay(_Memory(case), self.options, self.config)
        self.replay(replay)
        reader, planners = self.region_reader(), [kind() for kind in self.planners]
        for topic, _, data in case:
            if topic != "/scan":
                continue
            try:
                scan = LaserScan().deserialize(data)
            except Exception:       # a message on which genpy fails never reaches a callback
                continue
            try:
                regions = reader.read(scan.ranges, scan.angle_min, scan.angle_max, scan.angle_increment)
            except self.scan_error:
                continue
            for planner in planners:
                command = planner.update(regions=regions)
                if not all(map(math.isfinite, command)):
                    raise Wrong("%s commands %s" % (type(planner).__name__, command))


class StateFile(Target):
    """States of the mapper: damaged ones, and well-formed ones with changed contents."""

    name, cpu, weight = "state", 3.0, 1.0

    def prepare(self):
        import numpy as np

        from m2wr_gmapping.config import GmappingConfig
        from m2wr_gmapping.frontend.scan import LaserModel
        from m2wr_gmapping.io import state
        from m2wr_gmapping.kernel_warm_up import compile_kernels
        from m2wr_gmapping.mapper import Mapper
        compile_kernels()
        self.state, self.foreseen, self.numpy = state, (state.StateError,), np
        laser = LaserModel.from_message(-1.5, 1.5, 0.1, 31, 0.1, 8.0)
        config = GmappingConfig.from_mapping(dict(particles=2, threads=1, linearUpdate=0.2, xmin=-3.0, ymin=-3.0,
                                                  xmax=3.0, ymax=3.0))
        mapper = Mapper(config, laser)
        for k in range(4):
            mapper.process(mapper.reading(np.full(31, 3.0 - 0.1 * k)), np.array([0.3 * k, 0.0, 0.0]), 0.1 * k)
        self.taken = state.snapshot(mapper, dict(laser_frame="laser"))
        mapper.close()
        path = written("made.state", b"")
        state.save(path, self.taken)
        with open(path, "rb") as stream:
            self.whole = stream.read()

    def make(self, rng):
        """Return the bytes of a file, or a list of changes of a snapshot: (where, name or path, kind, number)."""
        if rng.randrange(3) == 0:
            return mutations.change_bytes(rng, self.whole)
        changes = []
        for _ in range(1 + int(rng.expovariate(0.7))):
            if rng.randrange(3):
                name = rng.choice(sorted(self.taken.arrays))
                changes.append(("array", name, rng.randrange(10), rng.randrange(2 ** 32)))
            else:
                changes.append(("value", rng.randrange(1000), rng.randrange(4), rng.randrange(2 ** 32)))
        return changes

    def describe(self, case):
        return case if isinstance(case, bytes) else repr(case).encode()

    def _file(self, case):
        if isinstance(case, bytes):
            return written("case.state", case)
        document, arrays = copy.deepcopy(self.taken.document), dict(self.taken.arrays)
        for where, name, kind, seed in case:
            rng = mutations.generator(seed, where, kind)
            if where == "array" and name in arrays:
                self._change_array(rng, arrays, name, kind)
            elif where == "value":
                self._change_value(rng, document, name, kind)
        path = written("case.state", b"")
        self.state.save(path, self.state.Snapshot(document, arrays))
        return path

    def _change_array(self, rng, arrays, name, kind):
        numpy, array = self.numpy, self.numpy.array(arrays[name])
        if kind == 0:
            del arrays[name]
        elif kind == 1:
            arrays[name] = numpy.zeros(rng.choice(((), (0,), (3,), (2, 2), (1000,), (1, 1, 1), (0, 5))), array.dtype)
        elif kind == 2:
            arrays[name] = array.astype(rng.choice(("f8", "f4", "i8", "i4", "i1", "u1", "?", "u8", "c16", "S3")))
        elif kind == 3:
            arrays[name] = array[:len(array) // 2] if array.ndim else array
        elif kind == 4:
            arrays[name] = numpy.concatenate((array, array)) if array.ndim else array
        elif array.size:
            for _ in range(1 + rng.randrange(3)):
                with numpy.errstate(all="ignore"):
                    value = numpy.array(rng.choice(mutations.FLOATS + mutations.INTEGERS + (-1, -2 ** 31)), float)
                    array.flat[rng.randrange(array.size)] = value.astype(array.dtype)
            arrays[name] = array

    def _change_value(self, rng, document, place, kind):
        leaves = []

        def walk(found):
            for key, value in sorted(found.items()) if isinstance(found, dict) else enumerate(found):
                leaves.append((found, key))
                if isinstance(value, (dict, list)):
                    walk(value)

        walk(document)
        parent, key = leaves[place % len(leaves)]
        if kind == 0:
            del parent[key]
        else:
            parent[key] = rng.choice((None, -1, 0, 1, 2 ** 31, 2 ** 70, 0.5, "nan", "x", [], {}, [1, 2], True, 1e308,
                                      {"a": []}, "0" * 2000, -2 ** 63))

    def run(self, case):
        try:
            found = self.state.load(self._file(case))
        except self.foreseen:
            return
        mapper = found.mapper
        try:
            mapper.process(mapper.reading(self.numpy.full(len(mapper.laser.angles), 2.0)), self.numpy.zeros(3), 9.0)
            mapper.occupancy(exact=False)
            mapper.finish()
            mapper.trajectory()
        except ValueError:
            pass                    # as for a scan that does not fit
        finally:
            mapper.close()
