# SPDX-License-Identifier: BSD-3-Clause
"""Triangle meshes and heightfields, which the Python binding does not offer, by native calls.

A :class:`NativeGeom` stands beside the binding's own geoms: it answers to the same calls, lives as long as its Python
object, and is handed to near callbacks like them.
"""
import ctypes
import math
import weakref

import numpy as np
import ode

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import IDENTITY
from m2wr_sim.physics import native_ode
from m2wr_sim.physics.engine import FARTHEST, LEAST_SIZE

_HANDLE, _REAL, _INT, _NUMBERS = ctypes.c_void_p, ctypes.c_double, ctypes.c_int, ctypes.POINTER(ctypes.c_double)
_SIGNATURES = (
    ("dGeomTriMeshDataCreate", _HANDLE, ()),
    ("dGeomTriMeshDataDestroy", None, (_HANDLE,)),
    ("dGeomTriMeshDataBuildDouble", None, (_HANDLE, _HANDLE, _INT, _INT, _HANDLE, _INT, _INT)),
    ("dCreateTriMesh", _HANDLE, (_HANDLE, _HANDLE, _HANDLE, _HANDLE, _HANDLE)),
    ("dGeomHeightfieldDataCreate", _HANDLE, ()),
    ("dGeomHeightfieldDataDestroy", None, (_HANDLE,)),
    ("dGeomHeightfieldDataBuildDouble", None,
     (_HANDLE, _HANDLE, _INT, _REAL, _REAL, _INT, _INT, _REAL, _REAL, _REAL, _INT)),
    ("dCreateHeightfield", _HANDLE, (_HANDLE, _HANDLE, _INT)),
    ("dGeomDestroy", None, (_HANDLE,)),
    ("dSpaceAdd", None, (_HANDLE, _HANDLE)),
    ("dSpaceRemove", None, (_HANDLE, _HANDLE)),
    ("dGeomGetBody", _HANDLE, (_HANDLE,)),
    ("dGeomSetBody", None, (_HANDLE, _HANDLE)),
    ("dGeomSetPosition", None, (_HANDLE, _REAL, _REAL, _REAL)),
    ("dGeomGetQuaternion", None, (_HANDLE, _NUMBERS)),
    ("dGeomSetQuaternion", None, (_HANDLE, _NUMBERS)),
    ("dGeomSetOffsetPosition", None, (_HANDLE, _REAL, _REAL, _REAL)),
    ("dGeomSetOffsetQuaternion", None, (_HANDLE, _NUMBERS)),
    ("dGeomSetCategoryBits", None, (_HANDLE, ctypes.c_ulong)),
    ("dGeomSetCollideBits", None, (_HANDLE, ctypes.c_ulong)),
)
# ODE's heightfields rise along their own y, with rows along z: a quarter turn about x brings y up and z to -y.
_UPRIGHT = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
_THICKNESS = 1.0        # m, thickness of a heightfield below its lowest point; as in Gazebo

_VERTEX_BYTES, _TRIANGLE_BYTES = 32, 12
_data = weakref.WeakValueDictionary()       # Mesh or Heightmap -> its data; the same table in many places is kept once
_prepared = None


def _library(where):
    """Return libode with the signatures this module needs; ModelError where it cannot be loaded by name."""
    global _prepared
    if _prepared is None:
        library = native_ode.library()
        if library is None:
            raise ModelError("%s: meshes and heightmaps need libode by name, and it cannot be loaded so; expected "
                             "libode.so.8" % where)
        for name, result, arguments in _SIGNATURES:
            function = getattr(library, name)
            function.restype, function.argtypes = result, list(arguments)
        _prepared = library
    return _prepared


class _MeshData:
    """Vertices and triangles as ODE reads them, while any geom does."""

    def __init__(self, library, mesh):
        self._library = library
        self._vertices = np.zeros((len(mesh.vertices), 4))
        self._vertices[:, :3] = mesh.vertices
        self._triangles = np.ascontiguousarray(mesh.triangles, dtype=np.uint32)
        self.handle = library.dGeomTriMeshDataCreate()
        library.dGeomTriMeshDataBuildDouble(
            self.handle, self._vertices.ctypes.data, _VERTEX_BYTES, len(self._vertices),
            self._triangles.ctypes.data, self._triangles.size, _TRIANGLE_BYTES)

    def __del__(self):
        self._library.dGeomTriMeshDataDestroy(self.handle)


class _HeightData:
    """Heights as ODE reads them, while any geom does."""

    def __init__(self, library, heightmap):
        self._library = library
        self._heights = np.ascontiguousarray(heightmap.heights, dtype=np.float64)
        rows, columns = self._heights.shape
        self.handle = library.dGeomHeightfieldDataCreate()
        library.dGeomHeightfieldDataBuildDouble(
            self.handle, self._heights.ctypes.data, 0, heightmap.size[0], heightmap.size[1], columns, rows, 1.0, 0.0,
            _THICKNESS, 0)

    def __del__(self):
        self._library.dGeomHeightfieldDataDestroy(self.handle)


class NativeGeom:
    """A geom made by native calls, with the methods of the binding's geoms that this package uses.

    Attributes
    ----------
    frame : Pose
        Of the geom in the collision's frame.
    """

    def __init__(self, library, handle, data, frame=IDENTITY):
        self._library, self._handle, self._data, self.frame = library, handle, data, frame
        ode._geom_c2py_lut[handle] = self       # weakly: where the binding looks up what it hands to callbacks

    def __del__(self):
        self._library.dGeomDestroy(self._handle)

    def _id(self):
        return self._handle

    @staticmethod
    def isSpace():
        return False

    def enter(self, space):
        self._library.dSpaceAdd(space._id(), self._handle)

    def leave(self, space):
        self._library.dSpaceRemove(space._id(), self._handle)

    def setBody(self, body):
        probe = ode.GeomSphere(None, 1.0)       # the binding does not tell a body's handle, but puts geoms on it
        probe.setBody(body)
        self._library.dGeomSetBody(self._handle, self._library.dGeomGetBody(probe._id()))

    def getQuaternion(self):
        numbers = (_REAL * 4)()
        self._library.dGeomGetQuaternion(self._handle, numbers)
        return tuple(numbers)

    def setPosition(self, position):
        self._library.dGeomSetPosition(self._handle, *position)

    def setQuaternion(self, quaternion):
        self._library.dGeomSetQuaternion(self._handle, (_REAL * 4)(*quaternion))

    def setOffsetPosition(self, position):
        self._library.dGeomSetOffsetPosition(self._handle, *position)

    def setOffsetQuaternion(self, quaternion):
        self._library.dGeomSetOffsetQuaternion(self._handle, (_REAL * 4)(*quaternion))

    def setCategoryBits(self, bits):
        self._library.dGeomSetCategoryBits(self._handle, bits)

    def setCollideBits(self, bits):
        self._library.dGeomSetCollideBits(self._handle, bits)


def enter_space(geom, space):
    """Put a geom into a space; the binding's own call takes only the binding's own geoms."""
    if isinstance(geom, NativeGeom):
        geom.enter(space)
    else:
        space.add(geom)


def leave_space(geom, space):
    """Take a geom out of a space; see :func:`enter_space`."""
    if isinstance(geom, NativeGeom):
        geom.leave(space)
    else:
        space.remove(geom)


def _data_of(kind, library, geometry):
    data = _data.get(geometry)
    if data is None:
        data = _data[geometry] = kind(library, geometry)
    return data


def prepare(geometry):
    """Build what ODE needs of a Mesh or Heightmap ahead of its geoms; may be called beside the simulation.

    Returns
    -------
    object or None
        To be kept until a geom uses it; None where libode cannot be called, which :func:`mesh_geom` reports.
    """
    try:
        return _data_of(_HeightData if hasattr(geometry, "heights") else _MeshData, _library("meshes"), geometry)
    except ModelError:
        return None


def mesh_geom(mesh, space, where):
    """Make a triangle mesh in a space.

    Raises
    ------
    ModelError
        If libode cannot be called, or the arrays are not those of a mesh.
    """
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3 \
            or not len(triangles) or triangles.min() < 0 or triangles.max() >= len(vertices) \
            or not np.all(np.isfinite(vertices)):
        raise ModelError("%s: a mesh with vertices %s and triangles %s; expected (n, 3) finite numbers and (m, 3) "
                         "indices into them" % (where, vertices.shape, triangles.shape))
    size = float(np.max(np.ptp(vertices, axis=0)))
    if not (LEAST_SIZE <= size and np.max(np.abs(vertices)) <= FARTHEST):
        raise ModelError("%s: a mesh %g m wide that reaches to %g m; expected at least %g m and at most %g m" % (
            where, size, np.max(np.abs(vertices)), LEAST_SIZE, FARTHEST))
    library = _library(where)
    data = _data_of(_MeshData, library, mesh)
    return NativeGeom(library, library.dCreateTriMesh(space._id(), data.handle, None, None, None), data)


def height_geom(heightmap, space, where):
    """Make a heightfield in a space.

    Raises
    ------
    ModelError
        If libode cannot be called, or the heights are not those of a field.
    """
    heights = np.asarray(heightmap.heights)
    if heights.ndim != 2 or min(heights.shape) < 2 or not np.all(np.isfinite(heights)) \
            or not all(LEAST_SIZE <= size <= FARTHEST for size in heightmap.size) \
            or np.max(np.abs(heights)) > FARTHEST:
        raise ModelError("%s: a heightmap of %s samples over %s m; expected at least 2 x 2 finite heights of at most "
                         "%g m over %g to %g m"
                         % (where, heights.shape, list(heightmap.size), FARTHEST, LEAST_SIZE, FARTHEST))
    library = _library(where)
    data = _data_of(_HeightData, library, heightmap)
    return NativeGeom(library, library.dCreateHeightfield(space._id(), data.handle, 1), data,
                      (tuple(heightmap.position), _UPRIGHT))
