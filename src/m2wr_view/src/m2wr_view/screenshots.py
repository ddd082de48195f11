# SPDX-License-Identifier: BSD-3-Clause
"""Writes screenshots: numbered files in a folder, each complete when it appears."""
import io
import os
import re

from m2wr_view.writers import make_folder, write_whole

_NAME = re.compile(r"^(\d{4,})_.*\.png$")
_LONGEST = 40               # letters of the reason in a file's name


def file_word(text):
    """Return a text as a part of a file's name."""
    return re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")[:_LONGEST] or "picture"


def png_file(image):
    """Return a picture as PNG; smaller than :func:`m2wr_view.writers.png_bytes` makes it, and slower."""
    stream = io.BytesIO()
    image.save(stream, "PNG", compress_level=6)
    return stream.getvalue()


class Screenshots:
    """Writes ``0000_start.png``, ``0001_wall_following.png`` and so on, after the existing ones.

    Parameters
    ----------
    folder : str
        Created if missing.

    Raises
    ------
    ViewError
        If it cannot be created or written to.
    """

    def __init__(self, folder):
        make_folder(folder)
        self.folder = folder
        numbers = [int(match.group(1)) for match in map(_NAME.match, os.listdir(folder)) if match]
        self._next = max(numbers, default=-1) + 1
        self.count = 0

    def save(self, image, why):
        """Write a picture and return its path; ViewError if that fails."""
        path = os.path.join(self.folder, "%04d_%s.png" % (self._next, file_word(why)))
        write_whole(path, png_file(image))
        self._next += 1
        self.count += 1
        return path
