# SPDX-License-Identifier: BSD-3-Clause
"""Writes screenshots: numbered files in a folder, each complete when it appears."""
from __future__ import annotations

import io
import os
import re

from PIL import Image

from m2wr_view.writers import make_folder, write_whole

_NAME = re.compile(r"^(\d{4,})_.*\.png$")
_LONGEST = 40               # letters of the reason in a file's name


def file_word(text: str) -> str:
    """Return a text as a part of a file's name."""
    return re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")[:_LONGEST] or "picture"


def png_file(image: Image.Image) -> bytes:
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

    def __init__(self, folder: str) -> None:
        make_folder(folder)
        self.folder = folder
        numbers = [int(match.group(1)) for match in map(_NAME.match, os.listdir(folder)) if match]
        self._next = max(numbers, default=-1) + 1
        self.count = 0

    def save(self, image: Image.Image, why: str) -> str:
        """Write a picture.

        Parameters
        ----------
        image : PIL.Image.Image
        why : str
            Reason, a part of the file's name.

        Returns
        -------
        str
            Path of the file.

        Raises
        ------
        ViewError
            If it cannot be written.
        """
        path = os.path.join(self.folder, "%04d_%s.png" % (self._next, file_word(why)))
        write_whole(path, png_file(image))
        self._next += 1
        self.count += 1
        return path
