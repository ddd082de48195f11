"""Where the centre of turning is, once that is known, told to the steps of the path that no scan held.

Array layouts
-------------
``steps`` (K, STEP_SIZE) float64
    A row for each processed scan, of the step that led to it, in the axes of the pose found:

    SILENT          projector on the direction in which the scan did not hold the place: xx, xy, yy; 0 where it did
    TURN, CENTRE    turn that odometry told of [rad], and how far ahead of the axle its centre was thought to be [m]
    APPLIED         change of the step that the path has already, x and y
"""
import math

from numba import njit

SILENT, TURN, CENTRE, APPLIED, STEP_SIZE = 0, 3, 4, 5, 7


@njit(cache=True, nogil=True, error_model='numpy')
def look_back(steps, count, centre, ahead, out):
    """Write how the first ``count`` steps would have been with the centre where it is known to be now.

    Parameters
    ----------
    steps : (S, STEP_SIZE) float64
    count : int
    centre : float
        How far odometry's centre lies ahead of that of turning, as it is known now [m].
    ahead : (2,) float64
        Forward direction of the base in the laser's frame.
    out : (count, 3) float64
        Written in the first two columns: what a step lacks still [m], in the axes of the pose it leads to; with APPLIED
        it is the whole change.
    """
    for k in range(count):
        row = steps[k]
        off, turn = centre - row[CENTRE], row[TURN]
        along, across = off * (1.0 - math.cos(turn)), off * math.sin(turn)
        x, y = ahead[0] * along - ahead[1] * across, ahead[1] * along + ahead[0] * across
        out[k, 0] = row[SILENT] * x + row[SILENT + 1] * y - row[APPLIED]
        out[k, 1] = row[SILENT + 1] * x + row[SILENT + 2] * y - row[APPLIED + 1]


@njit(cache=True, nogil=True, error_model='numpy')
def changed(path, changes, out):
    """Write into ``out`` (K, 3) a path (K, 3) to each of whose steps ``changes`` (K, 3) are appended.

    Those are in the axes of the pose that the step leads to; their headings are taken to be 0.
    """
    x = y = 0.0         # so far, in the map's axes: no heading changes
    for k in range(path.shape[0]):
        if k > 0:
            c, s = math.cos(path[k, 2]), math.sin(path[k, 2])
            x, y = x + c * changes[k, 0] - s * changes[k, 1], y + s * changes[k, 0] + c * changes[k, 1]
        out[k, 0], out[k, 1], out[k, 2] = path[k, 0] + x, path[k, 1] + y, path[k, 2]
