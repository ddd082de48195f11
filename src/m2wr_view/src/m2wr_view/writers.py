# SPDX-License-Identifier: BSD-3-Clause
"""Writes pictures: into a folder of PNG files, an animated GIF, or an MP4 by ffmpeg."""
from __future__ import annotations

import os
import shutil
import struct
import subprocess
import tempfile
import zlib
from typing import IO, Optional, Protocol, Union

import numpy as np
from PIL import GifImagePlugin, Image, ImageChops

from m2wr_view.errors import ViewError

GIF_COLOURS = 64            # of each picture
_FAST_OCTREE, _NO_DITHER = 2, 0     # of Image.quantize; old and new Pillows have other names for them
FFMPEG_PATIENCE = 60.0      # s for ffmpeg to finish its file


def png_bytes(image: Image.Image) -> bytes:
    """Return an RGB image as PNG.

    Rows are not filtered: drawings compress as well, in a third of Pillow's time.
    """
    width, height = image.size
    rows = np.zeros((height, 1 + 3 * width), dtype=np.uint8)
    rows[:, 1:] = np.asarray(image).reshape(height, 3 * width)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    return b"".join((b"\x89PNG\r\n\x1a\n", chunk(b"IHDR", struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)),
                     chunk(b"IDAT", zlib.compress(rows.data, 1)), chunk(b"IEND", b"")))


def _refusal(what: str, path: str, error: Union[BaseException, str], expected: str) -> str:
    return "%s %s: %s; expected %s" % (what, path, getattr(error, "strerror", None) or error, expected)


def write_whole(path: str, data: bytes) -> None:
    """Write a file atomically: under its name there is never an incomplete one.

    Parameters
    ----------
    path : str
        File or folder to write.
    data : bytes
        Content.

    Raises
    ------
    ViewError
        If it cannot be written.
    """
    temporary = None
    try:
        with tempfile.NamedTemporaryFile(dir=os.path.dirname(path) or ".", prefix=".", suffix=".part",
                                         delete=False) as stream:
            temporary = stream.name
            stream.write(data)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as error:
        if temporary is not None and os.path.exists(temporary):
            os.remove(temporary)
        raise ViewError(_refusal("picture", path, error, "a writable folder, and free space on the disk")) from error


def make_folder(path: str) -> None:
    """Create a folder if there is none; ViewError if it cannot be created or written to."""
    try:
        os.makedirs(path, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise ViewError(_refusal("folder", path, error, "a folder that can be created and written to")) from error


class Writer(Protocol):
    """What pictures are written to."""

    path: str
    count: int              # pictures so far

    def write(self, image: Image.Image) -> None:
        """Write one picture; ViewError if it cannot be written."""

    def close(self) -> None:
        """Finish the output; ViewError if that fails."""


class PngSeries:
    """Writes ``frame_00000.png`` and so on; each file is complete when it appears.

    Parameters
    ----------
    folder : str
        Created if missing.
    """

    def __init__(self, folder: str) -> None:
        make_folder(folder)
        self.path, self.count = folder, 0

    def write(self, image: Image.Image) -> None:
        """Write one picture."""
        write_whole(os.path.join(self.path, "frame_%05d.png" % self.count), png_bytes(image))
        self.count += 1

    def close(self) -> None:
        """Do nothing: all files are complete."""


class Gif:
    """Writes an animated GIF picture by picture, each as the rectangle that differs from the one before.

    The file can be shown even if it was never closed.

    Parameters
    ----------
    path : str
    frames_a_second : float
        Of the animation; GIF counts in hundredths of a second.
    """

    def __init__(self, path: str, frames_a_second: float) -> None:
        make_folder(os.path.dirname(path) or ".")
        self.path, self.count = path, 0
        self._stream: Optional[IO[bytes]] = None
        self._last: Optional[Image.Image] = None
        self._wait = max(2, int(round(100.0 / frames_a_second)))

    def write(self, image: Image.Image) -> None:
        """Append one picture; ViewError if it cannot be written."""
        try:
            if self._stream is None:
                self._stream = open(self.path, "wb")
                # no common palette, each picture has its own; repeated without end
                self._stream.write(struct.pack("<6s2H3B", b"GIF89a", image.width, image.height, 0x70, 0, 0)
                                   + b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00")
            self._stream.write(self._frame(image))
            self._stream.flush()
        except OSError as error:
            raise self._failed(error) from error
        self._last = image
        self.count += 1

    def _frame(self, image: Image.Image) -> bytes:
        box = (0, 0) + image.size
        if self._last is not None:
            box = ImageChops.difference(image, self._last).getbbox() or (0, 0, 1, 1)
        part = image.crop(box).quantize(GIF_COLOURS, method=_FAST_OCTREE, dither=_NO_DITHER)
        pieces = GifImagePlugin.getdata(part, box[:2], include_color_table=True)
        # left in place, so that the next one is drawn over it
        return struct.pack("<4BH2B", 0x21, 0xf9, 4, 1 << 2, self._wait, 0, 0) + b"".join(pieces)

    def close(self) -> None:
        """Finish the file; ViewError if it cannot be written."""
        if self._stream is None:
            return
        stream, self._stream = self._stream, None
        try:
            with stream:
                stream.write(b";")
        except OSError as error:
            raise self._failed(error) from error

    def _failed(self, error: Union[BaseException, str]) -> ViewError:
        return ViewError(_refusal("animation", self.path, error, "a writable folder, and free space on the disk"))


class Mp4:
    """Writes a film by ffmpeg; the file can be played even if it was never closed.

    Parameters
    ----------
    path : str
    frames_a_second : float
    program : str
        The ffmpeg to use.
    """

    def __init__(self, path: str, frames_a_second: float, program: str = "ffmpeg") -> None:
        found = shutil.which(program)
        if found is None:
            raise ViewError("film %s: there is no program %s; install it (apt install ffmpeg), or write .gif or a "
                            "folder of PNG files instead" % (path, program))
        make_folder(os.path.dirname(path) or ".")
        self.path, self.count = path, 0
        self._command = [found, "-loglevel", "error", "-nostdin", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"]
        self._rest = ["-r", "%g" % frames_a_second, "-i", "-", "-an", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2",
                      "-pix_fmt", "yuv420p", "-movflags", "+frag_keyframe+empty_moov", path]
        self._process: Optional[subprocess.Popen[bytes]] = None
        self._said: Optional[IO[bytes]] = None

    def write(self, image: Image.Image) -> None:
        """Append one picture; ViewError with the output of ffmpeg if it has ended."""
        try:
            if self._process is None:
                self._said = tempfile.TemporaryFile()
                self._process = subprocess.Popen(
                    self._command + ["-s", "%dx%d" % image.size] + self._rest, stdin=subprocess.PIPE,
                    stderr=self._said, stdout=subprocess.DEVNULL, start_new_session=True)    # Ctrl-C is for us only
            pipe = self._process.stdin
            assert pipe is not None         # stdin=PIPE
            pipe.write(image.tobytes())
        except OSError as error:
            raise self._failed(error) from error
        self.count += 1

    def close(self) -> None:
        """Wait until ffmpeg has finished the file.

        Raises
        ------
        ViewError
            If ffmpeg fails or does not end.
        """
        if self._process is None:
            return
        process, self._process = self._process, None
        try:
            if process.stdin is not None:
                process.stdin.close()
        except OSError:
            pass                            # it has ended already; see its exit code
        try:
            code = process.wait(FFMPEG_PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise ViewError("film %s: ffmpeg did not end within %g s" % (self.path, FFMPEG_PATIENCE)) from None
        if code:
            raise self._failed("it ended with %d" % code)

    def _failed(self, error: Union[BaseException, str]) -> ViewError:
        said = ""
        if self._said is not None:
            self._said.seek(0)
            said = self._said.read().decode(errors="replace").strip()
        return ViewError("film %s: ffmpeg: %s" % (self.path, said or error))


def make_writer(path: str, frames_a_second: float = 10.0) -> Writer:
    """Return the writer for a path: ``.gif``, ``.mp4``, anything else is a folder of PNG files.

    Parameters
    ----------
    path : str
        File or folder to write.
    frames_a_second : float
        Of a film [Hz].

    Raises
    ------
    ViewError
        If it cannot be written there, or ffmpeg is missing.
    """
    path = os.path.abspath(os.path.expanduser(path))
    ending = os.path.splitext(path)[1].lower()
    if ending == ".gif":
        return Gif(path, frames_a_second)
    if ending == ".mp4":
        return Mp4(path, frames_a_second)
    return PngSeries(path)
