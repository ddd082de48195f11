"""Grid mapping from laser scans and odometry: the object that the live node and the replay drive alike."""
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping import match_kernels as mk
from m2wr_gmapping import resampling
from m2wr_gmapping.hill_climb import HillClimbMatcher
from m2wr_gmapping.loop_closing import LoopCloser
from m2wr_gmapping.matcher import FastMatcher
from m2wr_gmapping.occupancy import Occupancy
from m2wr_gmapping.particle_filter import ParticleFilter
from m2wr_gmapping.se2 import between, compose, inverse
from m2wr_gmapping.workers import Workers

STILL = np.array([0.005, 0.005, 0.005])     # a scan from so near the last tracked one tells nothing new [m, m, rad]
STEP_FLOOR = np.array([0.01, 0.01, 0.01])   # least deviation of a step's odometry [m, m, rad]
STEP_SHARE = 0.05                           # and its least share of the step: odometry is never better than that
PARTICLE_PRIOR = 1.0 / np.square([0.05, 0.05, 0.03])    # particles differ from the tracked pose by no more [m, rad]
END_POINT_GAP = 0.04        # end points nearer to each other say the same again [m]
WINDOW_MOST = np.array([0.8, 0.9])          # a search beyond would take longer than a scan may
LONG_STEP = np.array([0.15, 0.15, 0.1])     # after such a step a plain match may be caught beside the right place
WINDOW_FLOOR, WINDOW_SHARE = np.array([0.2, 0.3]), 0.4      # half widths of the search [m, rad]; growth with the step


@dataclass(frozen=True)
class Update:
    """What one scan did.

    Attributes
    ----------
    processed : bool
        Whether the filter used the scan: weights, paths and maps have changed.
    tracked : bool
        Whether the scan gave a pose of its own.
    pose : (3,) float64
        Best estimate of the centred laser in ``map`` now.
    """

    processed: bool
    tracked: bool
    pose: np.ndarray


class Mapper:
    """A particle filter over grid maps, fed one scan at a time.

    Parameters
    ----------
    config : GmappingConfig
    laser : LaserModel
        For the base frame of the paths.
    """

    def __init__(self, config, laser):
        self.config, self.laser = config, laser
        self._workers = Workers(config["threads"])
        self._plain = config["compatible"]
        self._matcher = (HillClimbMatcher if self._plain else FastMatcher)(config, self._workers)
        self._tracks = config["track_between"] and not self._plain
        self._noise = config.noise
        self._loops = None
        if config["loop_closing"] and not self._plain:
            self._loops = LoopCloser(self._matcher, config["delta"])
        self.filter = None
        self.readings, self.stamps = [], []
        self._occupancy = Occupancy([config[name] for name in ("xmin", "ymin", "xmax", "ymax")], config["delta"],
                                    config["occ_thresh"])
        self._between = []              # (stamp, index of the processed scan before, pose relative to it)

    @property
    def processed(self):
        """Number of scans that the filter has used."""
        return len(self.stamps)

    @property
    def tracked(self):
        """Number of scans between processed ones that were matched as well."""
        return len(self._between)

    def reading(self, ranges):
        """Return the ScanReading of one message's ranges (B,), the way ``process`` wants it; raises ScanError."""
        return self.laser.reading(ranges, self.config["lskip"], 0.0 if self._plain else END_POINT_GAP)

    def process(self, reading, odom_pose, stamp):
        """Take one scan.

        Parameters
        ----------
        reading : ScanReading
            From ``reading``.
        odom_pose : (3,) float64
            Pose of the centred laser in ``odom`` when the scan was taken.
        stamp : float
            Its time [s].

        Returns
        -------
        Update

        Raises
        ------
        ValueError
            If the pose or the stamp is not finite.
        """
        odom_pose = np.asarray(odom_pose, float)
        if not (np.isfinite(odom_pose).all() and np.isfinite(stamp)):
            raise ValueError("odometry pose {} at {} is not finite".format(odom_pose.tolist(), stamp))
        if self.filter is None:
            return self._first(reading, odom_pose, stamp)
        step = between(self._odom, odom_pose)
        self._odom = odom_pose
        self._distance += float(np.hypot(step[0], step[1]))
        self._turn += abs(float(step[2]))
        if self._plain:
            self.filter.drift(step)
        due = self._due(stamp)
        tracked = False
        self._rel = compose(self._rel, step)
        self._since = compose(self._since, step)
        if not self._plain and (due or self._tracks) and (due or (np.abs(self._since) > STILL).any()):
            tracked = self._track(reading)
        if due:
            self._process_fully(reading, stamp)
        elif tracked:
            self._between.append((stamp, len(self.stamps) - 1, self._rel))
        return Update(due, tracked, self.pose)

    def _first(self, reading, odom_pose, stamp):
        self.filter = ParticleFilter(self.config, self._matcher, odom_pose)
        self.filter.register(reading)
        self._odom = self._anchor_odom = odom_pose
        self._remember(reading, stamp)
        return Update(True, False, self.pose)

    def _remember(self, reading, stamp):
        self.readings.append(reading)
        self.stamps.append(stamp)
        self._distance = self._turn = 0.0
        self._rel, self._since = np.zeros(3), np.zeros(3)
        self._anchor_odom = self._odom
        self._last_processed = stamp

    def _due(self, stamp):
        config = self.config
        return (self._distance >= config["linearUpdate"] or self._turn >= config["angularUpdate"]
                or 0.0 <= config["temporalUpdate"] < stamp - self._last_processed)

    def _deviations(self, step):
        """How far off an odometry step may be (3,): what the user says, and a floor for wheels that slip."""
        size = np.hypot(step[0], step[1])
        return self._noise.deviations(step) + STEP_FLOOR + STEP_SHARE * np.array([size, size, abs(step[2])])

    def _track(self, reading):
        """Match the scan in the best particle's map; move the pose since the last processed scan to the match."""
        prior = 1.0 / np.square(self._deviations(self._since))
        step = self._since
        self._since = np.zeros(3)
        if not reading.beams.shape[1]:
            return False
        best = self.filter.best
        anchor = self.filter.poses[best]
        window = WINDOW_FLOOR + WINDOW_SHARE * np.array([np.hypot(step[0], step[1]), abs(step[2])])
        window = np.minimum(window, WINDOW_MOST)
        row = self._matcher.track(self.filter.maps, best, reading, compose(anchor, self._rel), prior, window,
                                  bool((np.abs(step) > LONG_STEP).any()))
        self._rel = between(anchor, row[:3])
        return True

    def _process_fully(self, reading, stamp):
        particles = self.filter
        if self._plain:
            prior, sample = np.zeros(3), None
        else:
            odometry = between(self._anchor_odom, self._odom)
            particles.poses = compose(particles.poses, self._rel)
            prior, sample = PARTICLE_PRIOR, self._noise.deviations(odometry)
        rows = particles.match(reading, prior, self.config["minimumScore"], sample)
        best = particles.best
        particles.resample()
        particles.register(reading)
        deviations = None if self._plain else self._deviations(between(self._anchor_odom, self._odom))
        self._remember(reading, stamp)
        if self._loops is not None:
            self._loops.add_step(rows[best, mk.INFORMATION:], deviations)
            self._bend(self._loops.look(particles.tree.path(particles.best), self.readings))

    def _bend(self, path):
        if path is not None:
            self.filter.replace_past(path, self.readings)

    def finish(self):
        """Bring the path and the maps to agree with all that is known; call when no scan follows, or before saving."""
        if self._loops is not None and self.filter is not None:
            self._bend(self._loops.solve(self.filter.tree.path(self.filter.best)))

    def info(self):
        """Return counts for the log (dict)."""
        loops = self._loops
        return {} if loops is None else dict(searches=loops.searches, links=loops.links, closures=loops.closures)

    @property
    def pose(self):
        """Best estimate (3,) of the centred laser in ``map`` at the last scan."""
        best = self.filter.poses[self.filter.best]
        return best.copy() if self._plain else compose(best, self._rel)

    @property
    def map_from_odom(self):
        """Transform (3,) that takes odometry coordinates to map coordinates."""
        return compose(self.pose, inverse(self._odom))

    @property
    def entropy(self):
        """Entropy of the normalised weights, between 0 and ln(particles)."""
        return resampling.entropy(self.filter.weights)

    def occupancy(self, exact=True):
        """Return the map (Grid) of the best particle's path.

        Without ``exact``, scans that would be drawn within a third of a cell of where they are stay there. Only what
        has changed since the last call is traced. To make a map on another thread, take ``map_request`` between two
        scans and give it to ``map_of`` there.
        """
        return self.map_of(*self.map_request(), exact=exact)

    def map_request(self):
        """Return what ``map_of`` needs, as it is now: the best path (K, 3) and its readings."""
        return self.filter.tree.path(self.filter.best), list(self.readings)

    def map_of(self, path, readings, exact=False):
        """Return the map (Grid) of a path; one caller at a time, and with paths in the order they were taken."""
        self._occupancy.update(path, readings, exact)
        return self._occupancy.grid()

    def base_poses(self, poses):
        """Return poses (..., 3) of the base from those of the centred laser."""
        return compose(poses, inverse(self.laser.base_from_sensor))

    def trajectory(self, between_too=True):
        """Return stamps (K,) and base poses (K, 3) of the best particle's path, with all that is known by now.

        With ``between_too`` the scans that were matched between processed ones are in it as well; where the filter has
        corrected the end of such a stretch, the correction is spread over it.
        """
        path = self.filter.tree.path(self.filter.best)
        stamps, poses = list(self.stamps), list(path)
        if between_too:
            for stamp, index, rel in self._between:
                stamps.append(stamp)
                poses.append(compose(path[index], rel))
        order = np.argsort(np.array(stamps), kind="stable")
        return np.array(stamps)[order], self.base_poses(np.array(poses).reshape(-1, 3)[order])

    def close(self):
        """End the threads."""
        self._workers.close()


assert mk.POSE == 0
