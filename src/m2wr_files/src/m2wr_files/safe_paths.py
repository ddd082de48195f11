# SPDX-License-Identifier: BSD-3-Clause
"""Restriction of file names from clients to one folder."""
from __future__ import annotations

import os
import stat


class OutsideError(ValueError):
    """A name is outside the folder or no file; the message names the folder."""


def confined(folder: str, name: str, parameter: str) -> str:
    """Return the real path of a file that a client of a service has named.

    Parameters
    ----------
    folder : str
        All files are inside it; it is created if missing.
    name : str
        Relative to the folder, or an absolute path inside it.
    parameter : str
        Parameter that sets the folder, for messages.

    Returns
    -------
    str

    Raises
    ------
    OutsideError
        If the path leaves the folder, also by ``..`` or a link, or is no regular file.
    """
    expected = "; expected a file in {}, which the parameter {} sets".format(folder, parameter)
    if "\0" in name or len(name) > 1000 or name.startswith("~") or ".." in name.split("/"):
        raise OutsideError("{!r:.120} is no name that is taken over a service{}".format(name, expected))
    try:
        os.makedirs(folder, exist_ok=True)
        root = os.path.realpath(folder)
        path = os.path.realpath(os.path.join(root, name))
        if not path.startswith(root.rstrip("/") + "/"):
            raise OutsideError("{!r:.120} leads out of the folder{}".format(name, expected))
        found = os.lstat(path).st_mode
    except FileNotFoundError:
        return path
    except (OSError, ValueError) as error:
        if isinstance(error, OutsideError):
            raise
        raise OutsideError("{!r:.120}: {}{}".format(
            name, getattr(error, "strerror", None) or error, expected)) from error
    if not stat.S_ISREG(found):
        raise OutsideError("{!r:.120} is no regular file{}".format(name, expected))
    return path
