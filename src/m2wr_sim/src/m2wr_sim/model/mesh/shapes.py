# SPDX-License-Identifier: BSD-3-Clause
"""``<mesh>``, ``<heightmap>`` and ``<polyline>`` of SDF, ``<mesh>`` of URDF -> Mesh and Heightmap records.

A shape whose file cannot be found or read is left out with a warning that names its element; the rest is loaded.
"""
from __future__ import annotations

import os
import posixpath
import warnings
from typing import TYPE_CHECKING, Any, List, Optional, Sequence, Tuple

import numpy as np

from m2wr_sim.errors import SimError
from m2wr_sim.model.mesh.files import FARTHEST_VERTEX, MeshPart, read_mesh_file
from m2wr_sim.model.mesh.polyline import extrude
from m2wr_sim.model.model_folders import tell_stand_in
from m2wr_sim.model.source_files import note_file
from m2wr_sim.model.types import Heightmap, Mesh, MeshFile
from m2wr_sim.model.xml.safe import XmlError, fail, file_of, parse_vector, place

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.model.mesh.shape_element import ShapeElement
    from m2wr_sim.model.model_folders import ResolveModel, ResolvePackage
    from m2wr_sim.model.notes import Notes

_DEFAULT_SAMPLING = 2       # SDF's
_PICTURES = ("PNG", "PPM", "BMP", "GIF", "JPEG", "TIFF")     # others may start programs to be read
_MAX_PIXELS = 4097 * 4097
_MOST_CELLS = 4096 * 4096   # of a heightmap: 4097 x 4097 samples, 134 MB


def _below(rest: str) -> str:
    """Return ``NAME/path`` without double slashes and ``..``; raise XmlError if these lead out of NAME."""
    name, _, inside = rest.replace("\\", "/").lstrip("/").partition("/")
    inside = posixpath.normpath("./" + inside.lstrip("/"))
    if name == ".." or inside.split("/")[0] == "..":
        raise XmlError('the path leaves its folder; expected one without ".."')
    return name + "/" + inside


class MeshReader:
    """Finds and reads the files that shapes name.

    Parameters
    ----------
    notes : Notes
        Gets warnings about ignored parts.
    resolve_model : callable or None
        ``resolve_model("model://NAME/path")`` gives a path or None; see
        :class:`m2wr_sim.model.model_folders.ModelFolders`.
    resolve_package : callable or None
        ``resolve_package(name)`` gives the folder of a package.
    """

    def __init__(self, notes: Notes, resolve_model: Optional[ResolveModel] = None,
                 resolve_package: Optional[ResolvePackage] = None) -> None:
        self._notes, self._resolve_model, self._resolve_package = notes, resolve_model, resolve_package

    # ---- elements ----------------------------------------------------------------------------------------------

    def mesh(self, node: ShapeElement) -> Optional[Mesh]:
        """Read ``<mesh>`` of SDF; return None, after a warning, if it is left out.

        Raises
        ------
        XmlError
            If the element itself is malformed.
        """
        uri = node.text("uri") or node.text("filename")
        if not uri:
            node.fail("<uri> is missing or empty", "the file of the mesh there")
        scale, submesh = node.strict_vector("scale", 3, (1.0, 1.0, 1.0)), node.child("submesh")
        if 0.0 in scale:
            fail(node.child("scale").element, "scale is {:g} {:g} {:g}".format(*scale), "three numbers that are not 0")
        name, centred = submesh.text("name") or None, submesh.flag("center", False)
        return self._mesh(node.element, uri, scale, name, bool(name) and centred)

    def urdf_mesh(self, element: Any, filename: str, scale: Optional[Sequence[float]]) -> Optional[Mesh]:
        """Return the Mesh of a URDF ``<mesh>``; None, after a warning, if it is left out.

        Parameters
        ----------
        element : lxml element
            For messages.
        filename : str
            URI or path.
        scale : (3,) sequence of float, optional

        Returns
        -------
        Mesh or None
        """
        return self._mesh(element, filename, tuple(float(value) for value in scale or (1.0, 1.0, 1.0)), None, False)

    def mesh_file(self, node: ShapeElement) -> MeshFile:
        """Return the file of the ``<mesh>`` of a visual in SDF, which is not opened.

        Raises
        ------
        XmlError
            If the element itself is malformed.
        """
        uri = node.text("uri") or node.text("filename")
        if not uri:
            node.fail("<uri> is missing or empty", "the file of the mesh there")
        x, y, z = node.strict_vector("scale", 3, (1.0, 1.0, 1.0))
        submesh = node.child("submesh")
        name, centred = submesh.text("name") or None, submesh.flag("center", False)
        return MeshFile(self._found(uri, node.element), uri, (x, y, z), name, bool(name) and centred)

    def urdf_mesh_file(self, element: Any, filename: str, scale: Optional[Sequence[float]]) -> MeshFile:
        """Return the file of the ``<mesh>`` of a visual in URDF, which is not opened.

        Parameters
        ----------
        element : lxml element
        filename : str
            URI or path.
        scale : (3,) sequence of float, optional

        Returns
        -------
        MeshFile
        """
        x, y, z = (float(value) for value in scale or (1.0, 1.0, 1.0))
        return MeshFile(self._found(filename, element), filename, (x, y, z))

    def folders(self, uris: Sequence[str], element: Any) -> Tuple[str, ...]:
        """Return the paths of the files and folders of material scripts; those that do not exist are left out.

        Parameters
        ----------
        uris : sequence of str
        element : object
            In which they stand, for messages.
        """
        return tuple(path for path in (self._found(uri, element, True) for uri in uris if uri) if path)

    def _found(self, uri: str, element: Any, folder: bool = False) -> str:
        """Return the path of a file, or of a folder if it may be one; empty if there is none."""
        try:
            return self._find(uri, element, folder)
        except SimError:
            return ""

    def heightmap(self, node: ShapeElement) -> Optional[Heightmap]:
        """Read ``<heightmap>``; return None, after a warning, if it is left out.

        The brightest pixel has the height of ``<size>``, black is 0; between pixels heights are interpolated, so
        that each pixel gives ``<sampling>`` samples a side.

        Raises
        ------
        XmlError
            If the element itself is malformed.
        """
        uri, element = node.text("uri"), node.element
        if not uri:
            node.fail("<uri> is missing or empty", "the picture with the heights there")
        size, position = node.strict_vector("size", 3, (1.0, 1.0, 1.0)), node.vector("pos", 3, (0.0, 0.0, 0.0))
        if min(size[0], size[1]) <= 0.0 or max(abs(value) for value in size) > FARTHEST_VERTEX:
            fail(node.child("size").element, "size is {:g} {:g} {:g}".format(*size),
                 "a positive extent in x and y, of at most {:g} m".format(FARTHEST_VERTEX))
        sampling = node.whole("sampling", _DEFAULT_SAMPLING, 1)
        try:
            path = self._find(uri, element)
            levels = _read_levels(path)
        except SimError as error:
            self._leave_out(element, "heightmap {}: {}".format(uri, error))
            return None
        heights = _heights(levels, abs(size[2]), size[2] < 0.0)
        wanted = sampling
        while sampling > 1 and _cells(heights, sampling) > _MOST_CELLS:
            sampling -= 1
        if _cells(heights, sampling) > _MOST_CELLS:
            self._leave_out(element, "heightmap {}: the picture has {} x {} pixels; expected at most {} cells between "
                            "them".format(uri, heights.shape[1], heights.shape[0], _MOST_CELLS))
            return None
        if sampling != wanted:
            self._notes.add("{}: heightmap {}: <sampling> {} would make more than {} cells; using {}.".format(
                place(element), uri, wanted, _MOST_CELLS, sampling))
        return Heightmap(_sampled(heights, sampling), (size[0], size[1]), position, path)

    def polyline(self, nodes: Sequence[ShapeElement]) -> Mesh:
        """Read the ``<polyline>`` elements of one geometry, which make one body.

        Raises
        ------
        XmlError
            If an outline has fewer than three corners or the height is not positive.
        """
        outlines = []
        for node in nodes:
            corners = [parse_vector(point.element, point.own_text(), 2, "point") for point in node.children("point")]
            if len(corners) > 1 and corners[0] == corners[-1]:
                corners.pop()
            if len(corners) < 3:
                node.fail("there are {} different <point> elements".format(len(corners)), "at least three")
            outlines.append(corners)
            node.text("height")         # the first one is used for all
        height = nodes[0].positive("height")
        if max(height, max(abs(value) for corners in outlines for corner in corners for value in corner)) \
                > FARTHEST_VERTEX:
            nodes[0].fail("a corner lies beyond {:g} m".format(FARTHEST_VERTEX), "corners within that")
        vertices, triangles = extrude(outlines, height)
        if not len(triangles):
            nodes[0].fail("the outline encloses no area", "corners that are not all on one line")
        return Mesh(vertices, triangles, nodes[0].place)

    # ---- files -------------------------------------------------------------------------------------------------

    def _mesh(self, element: Any, uri: str, scale: Sequence[float], submesh: Optional[str],
              centred: bool) -> Optional[Mesh]:
        try:
            path = self._find(uri, element)
            tell_stand_in(self._notes, self._resolve_model, path)
            parts: Sequence[MeshPart] = read_mesh_file(path)
            if submesh is not None:
                known = sorted({name for part in parts for name in part.names})
                parts = [part for part in parts if submesh in part.names]
                if not parts:
                    raise XmlError('{}: it has no submesh "{}"; expected one of {}'.format(
                        path, submesh, ", ".join(known) or "none"))
        except SimError as error:
            self._leave_out(element, "mesh {}: {}".format(uri, error))
            return None
        starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
        vertices = np.concatenate([part.vertices for part in parts])
        triangles = np.concatenate([part.triangles + np.int32(start) for part, start in zip(parts, starts)])
        if centred:
            used = vertices[triangles.ravel()]
            vertices = vertices - 0.5 * (used.min(axis=0) + used.max(axis=0))
        vertices = np.ascontiguousarray(vertices * scale)
        if not np.all(np.abs(vertices) <= FARTHEST_VERTEX):
            self._leave_out(element, "mesh {}: scaled by {:g} {:g} {:g} it reaches beyond {:g} m".format(
                uri, *scale, FARTHEST_VERTEX))
            return None
        if np.prod(np.sign(scale)) < 0.0:       # a mirror turns the faces inside out
            triangles = triangles[:, ::-1]
        return Mesh(vertices, np.ascontiguousarray(triangles, dtype=np.int32), path)

    def _leave_out(self, element: Any, reason: str) -> None:
        self._notes.add("{}: {}; this collision is left out.".format(
            place(element), reason.rstrip(".")))

    def _find(self, uri: str, element: Any, folder: bool = False) -> str:
        """Return the path of a URI; of a folder too if ``folder``.

        Raises
        ------
        SimError
            If it leaves its folder through ``..``, would have to be downloaded, or is not on this machine.
        """
        scheme, mark, rest = uri.strip().partition("://")
        scheme, rest = (scheme.lower(), rest) if mark else ("", uri.strip())
        if scheme in ("", "file") and os.path.isabs(rest):
            candidates: List[Optional[str]] = [rest]
        elif scheme in ("", "file"):
            beside = os.path.join(os.path.dirname(file_of(element)), rest)
            candidates = [beside]
            note_file(beside)
            if self._resolve_model is not None and not os.path.isfile(beside):
                candidates.append(self._resolve_model("file://" + rest))
        elif scheme in ("model", "package"):
            rest = _below(rest)
            candidates = self._in_packages(scheme, rest)
        else:
            raise XmlError("nothing is downloaded; expected model://, package://, file:// or a path")
        if ".." in rest.replace("\\", "/").split("/"):
            raise XmlError('the path leaves its folder; expected one without ".."')
        if folder:
            in_folders = getattr(self._resolve_model, "folder", None)
            candidates.append(in_folders(uri.strip()) if in_folders is not None and not os.path.isabs(rest) else None)
        for candidate in candidates:
            note_file(candidate or "")
            if candidate is not None and (os.path.isfile(candidate) or (folder and os.path.isdir(candidate))):
                return candidate
        raise XmlError("there is no such file (searched: {}); expected one that is on this machine".format(
            ", ".join(os.path.dirname(candidate) or "." for candidate in candidates if candidate)
            or str(self._resolve_model or "no folders")))

    def _in_packages(self, scheme: str, rest: str) -> List[Optional[str]]:
        """Return candidates for a ``model://`` or ``package://`` path; Gazebo accepts one for the other."""
        name, _, inside = rest.partition("/")
        found: List[Optional[str]] = []
        if scheme == "package" or self._resolve_model is None:
            found.append(self._package_path(name, inside, scheme == "package"))
        if scheme == "package" and self._resolve_package is None and self._resolve_model is not None:
            found.append(self._resolve_model("package://" + rest))
        if self._resolve_model is not None and not any(found):
            found.append(self._resolve_model("model://" + rest))
        return found

    def _package_path(self, name: str, inside: str, asked: bool) -> Optional[str]:
        if self._resolve_package is None:
            return None
        try:
            return os.path.join(self._resolve_package(name), inside)
        except Exception as error:      # rospkg's own kinds of error, and others that resolve packages
            if asked:
                raise XmlError('there is no package "{}" ({}); expected one that rospack finds'.format(
                    name, error)) from None
            return None


def _read_levels(path: str) -> NDArray[np.float64]:
    """Return the brightness of a picture's pixels, (rows, columns) float64 from 0 to 1; row 0 is the top."""
    try:
        from PIL import Image
    except ImportError as error:
        raise XmlError("{}: {}; expected the Python package Pillow, which reads pictures".format(path, error)) from None
    note_file(path)
    try:
        if not os.path.isfile(path):
            raise XmlError("{}: is no regular file; expected a picture such as a PNG".format(path))
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            opened = Image.open(path)
        with opened as picture:
            if picture.format not in _PICTURES:
                raise XmlError("{}: is a {} picture; expected one of {}".format(
                    path, picture.format, ", ".join(_PICTURES)))
            if picture.size[0] * picture.size[1] > _MAX_PIXELS:
                raise XmlError("{}: the picture has {} x {} pixels; expected at most {} in all".format(
                    path, picture.size[0], picture.size[1], _MAX_PIXELS))
            if picture.mode in ("I;16", "I;16B", "I;16L", "I", "F"):
                levels = np.asarray(picture, dtype=np.float64)
                levels = levels / (65535.0 if picture.mode != "F" else 1.0)
            else:
                levels = np.asarray(picture.convert("RGB").getchannel(0), dtype=np.float64) / 255.0
    except XmlError:
        raise
    except (Image.DecompressionBombError, Image.DecompressionBombWarning):      # the picture was not unpacked
        raise XmlError("{}: the picture has more than {} pixels; expected at most {} in all".format(
            path, Image.MAX_IMAGE_PIXELS, _MAX_PIXELS)) from None
    except Exception as error:      # any error of the parser in a broken file
        raise XmlError("{}: cannot be read: {}; expected a picture such as a PNG".format(path, error)) from None
    if min(levels.shape) < 2 or not np.all(np.isfinite(levels)):
        raise XmlError("{}: the picture has {} x {} pixels; expected at least 2 x 2, all finite".format(
            path, levels.shape[1], levels.shape[0]))
    return levels


def _heights(levels: NDArray[np.float64], height: float, inverted: bool) -> NDArray[np.float64]:
    """Scale brightness so that the brightest pixel, or black if ``inverted``, has ``height`` [m]."""
    brightest = levels.max()
    shares = levels / brightest if brightest > 0.0 else levels
    return height * ((1.0 - shares) if inverted else shares)


def _cells(heights: NDArray[np.float64], sampling: int) -> int:
    return ((heights.shape[0] - 1) * sampling) * ((heights.shape[1] - 1) * sampling)


def _sampled(heights: NDArray[np.float64], sampling: int) -> NDArray[np.float64]:
    """Insert ``sampling`` - 1 interpolated samples between neighbours, in both directions."""
    if sampling == 1:
        return np.ascontiguousarray(heights)
    for axis in (0, 1):
        count = heights.shape[axis]
        places = np.arange((count - 1) * sampling + 1) / sampling
        before = np.minimum(places.astype(np.int64), count - 2)
        share = (places - before).reshape((-1, 1) if axis == 0 else (1, -1))
        one, two = np.take(heights, before, axis=axis), np.take(heights, before + 1, axis=axis)
        heights = one + (two - one) * share
    return np.ascontiguousarray(heights)
