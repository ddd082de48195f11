# SPDX-License-Identifier: BSD-3-Clause
"""Triangle meshes and heightfields by native calls; the Python binding does not have them.

A :class:`NativeGeom` is used like the geoms of the binding: it has the same methods, exists as long as its Python
object, and is passed to near callbacks.
"""
from __future__ import annotations

import ctypes
import math
import weakref
from typing import TYPE_CHECKING, Any, Callable, MutableMapping, Optional, Sequence, Union

import numpy as np
import ode

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import IDENTITY
from m2wr_sim.physics import native_ode
from m2wr_sim.physics.engine import FARTHEST, LEAST_SIZE
from m2wr_sim.physics.height_field_kernels import tops_of

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose, Quaternion, Vector
    from m2wr_sim.model.types import Heightmap, Mesh

    #: A geom of the binding or one of this module.
    Geom = Union[ode.GeomObject, "NativeGeom"]
    _Data = Union["_MeshData", "_HeightData"]

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
# In ODE's heightfields y is up and rows are along z; this rotation about x makes z up and rows along -y.
_UPRIGHT = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
_THICKNESS = 1.0        # m, thickness of a heightfield below its lowest point; as in Gazebo

_VERTEX_BYTES, _TRIANGLE_BYTES = 32, 12
# Mesh or Heightmap -> its data: geoms with equal geometry share it
_data: MutableMapping[Union[Mesh, Heightmap], _Data] = weakref.WeakValueDictionary()
_prepared: Any = None           # libode with the signatures of this module


def _library(where: str) -> Any:
    """Return libode with the signatures for this module; raise ModelError if it cannot be loaded by name."""
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
    """Vertices and triangles in ODE's format; must exist as long as a geom uses them."""

    def __init__(self, library: Any, mesh: Mesh) -> None:
        self._library = library
        self._vertices = np.zeros((len(mesh.vertices), 4))
        self._vertices[:, :3] = mesh.vertices
        self._triangles = np.ascontiguousarray(mesh.triangles, dtype=np.uint32)
        self.handle = library.dGeomTriMeshDataCreate()
        library.dGeomTriMeshDataBuildDouble(
            self.handle, self._vertices.ctypes.data, _VERTEX_BYTES, len(self._vertices),
            self._triangles.ctypes.data, self._triangles.size, _TRIANGLE_BYTES)

    def __del__(self) -> None:
        self._library.dGeomTriMeshDataDestroy(self.handle)


class _HeightData:
    """Heights in ODE's format; must exist as long as a geom uses them.

    Attributes
    ----------
    heights : (rows, columns) float64
    tops : (n,) float64
        See :func:`m2wr_sim.physics.height_field_kernels.tops_of`.
    cell : (2,) float64
        Size of a cell along x and y [m].
    """

    def __init__(self, library: Any, heightmap: Heightmap) -> None:
        self._library = library
        self.heights = np.ascontiguousarray(heightmap.heights, dtype=np.float64)
        rows, columns = self.heights.shape
        self.tops = tops_of(self.heights)
        self.cell = np.array((heightmap.size[0] / (columns - 1), heightmap.size[1] / (rows - 1)))
        self.handle = library.dGeomHeightfieldDataCreate()
        library.dGeomHeightfieldDataBuildDouble(
            self.handle, self.heights.ctypes.data, 0, heightmap.size[0], heightmap.size[1], columns, rows, 1.0, 0.0,
            _THICKNESS, 0)

    def __del__(self) -> None:
        self._library.dGeomHeightfieldDataDestroy(self.handle)


class NativeGeom:
    """A geom made by native calls, with the methods of the binding's geoms that this package uses.

    Parameters
    ----------
    library : ctypes.CDLL
        libode.
    handle : int
        Native handle of the geom, which is destroyed with this object.
    data : object
        Kept as long as the geom exists.
    frame : pose
        Of the geom in the frame of the collision.
    """

    def __init__(self, library: Any, handle: int, data: object, frame: Pose = IDENTITY) -> None:
        self._library, self._handle, self._data, self.frame = library, handle, data, frame
        ode._geom_c2py_lut[handle] = self       # weak references, from which the binding takes callback arguments

    def __del__(self) -> None:
        self._library.dGeomDestroy(self._handle)

    def _id(self) -> int:
        return self._handle

    @property
    def heights(self) -> Any:
        """The samples of a heightmap: ``heights``, ``tops`` and ``cell`` for height_kernels."""
        return self._data

    @staticmethod
    def isSpace() -> bool:
        return False

    def enter(self, space: ode.SpaceBase) -> None:
        """Add the geom to a space."""
        self._library.dSpaceAdd(space._id(), self._handle)

    def leave(self, space: ode.SpaceBase) -> None:
        """Remove the geom from a space."""
        self._library.dSpaceRemove(space._id(), self._handle)

    def setBody(self, body: ode.Body) -> None:
        probe = ode.GeomSphere(None, 1.0)       # the handle of a body is known only through a geom of the binding
        probe.setBody(body)
        self._library.dGeomSetBody(self._handle, self._library.dGeomGetBody(probe._id()))

    def getQuaternion(self) -> Quaternion:
        numbers = (_REAL * 4)()
        self._library.dGeomGetQuaternion(self._handle, numbers)
        w, x, y, z = numbers
        return (w, x, y, z)

    def setPosition(self, position: Vector) -> None:
        self._library.dGeomSetPosition(self._handle, *position)

    def setQuaternion(self, quaternion: Sequence[float]) -> None:
        self._library.dGeomSetQuaternion(self._handle, (_REAL * 4)(*quaternion))

    def setOffsetPosition(self, position: Vector) -> None:
        self._library.dGeomSetOffsetPosition(self._handle, *position)

    def setOffsetQuaternion(self, quaternion: Sequence[float]) -> None:
        self._library.dGeomSetOffsetQuaternion(self._handle, (_REAL * 4)(*quaternion))

    def setCategoryBits(self, bits: int) -> None:
        self._library.dGeomSetCategoryBits(self._handle, bits)

    def setCollideBits(self, bits: int) -> None:
        self._library.dGeomSetCollideBits(self._handle, bits)


def enter_space(geom: Geom, space: ode.SpaceBase) -> None:
    """Add a geom to a space; the binding's method accepts only the binding's geoms.

    Parameters
    ----------
    geom : ode.GeomObject or NativeGeom
    space : ode.SpaceBase
    """
    if isinstance(geom, NativeGeom):
        geom.enter(space)
    else:
        space.add(geom)


def leave_space(geom: Geom, space: ode.SpaceBase) -> None:
    """Remove a geom from a space; see :func:`enter_space`.

    Parameters
    ----------
    geom : ode.GeomObject or NativeGeom
    space : ode.SpaceBase
    """
    if isinstance(geom, NativeGeom):
        geom.leave(space)
    else:
        space.remove(geom)


def _data_of(kind: Callable[[Any, Any], _Data], library: Any, geometry: Union[Mesh, Heightmap]) -> _Data:
    data = _data.get(geometry)
    if data is None:
        data = _data[geometry] = kind(library, geometry)
    return data


def prepare(geometry: Union[Mesh, Heightmap]) -> Optional[object]:
    """Build ODE's data of a Mesh or Heightmap before its geoms; may be called in another thread.

    Returns
    -------
    object or None
        To be kept until a geom uses it; None if libode cannot be loaded by name, which :func:`mesh_geom` reports.
    """
    try:
        return _data_of(_HeightData if hasattr(geometry, "heights") else _MeshData, _library("meshes"), geometry)
    except ModelError:
        return None


def mesh_geom(mesh: Mesh, space: ode.SpaceBase, where: str) -> NativeGeom:
    """Make a triangle mesh in a space.

    Parameters
    ----------
    mesh : m2wr_sim.model.types.Mesh
    space : ode.SpaceBase
    where : str
        ``model::link::collision``, for messages.

    Returns
    -------
    NativeGeom

    Raises
    ------
    ModelError
        If libode cannot be loaded by name, or the mesh is invalid or out of range.
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


def height_geom(heightmap: Heightmap, space: ode.SpaceBase, where: str) -> NativeGeom:
    """Make a heightfield in a space.

    Parameters
    ----------
    heightmap : m2wr_sim.model.types.Heightmap
    space : ode.SpaceBase
    where : str
        ``model::link::collision``, for messages.

    Returns
    -------
    NativeGeom

    Raises
    ------
    ModelError
        If libode cannot be loaded by name, or the heights are invalid or out of range.
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
                      (heightmap.position, _UPRIGHT))
