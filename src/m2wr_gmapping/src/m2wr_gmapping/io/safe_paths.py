# SPDX-License-Identifier: BSD-3-Clause
"""File names that somebody else chose, kept inside one folder."""
import os
import stat


class OutsideError(ValueError):
    """A name leads out of the folder, or to what is no file; says where names may lead."""


def confined(folder, name, parameter):
    """Return the real path of a file whose name came over a service.

    Parameters
    ----------
    folder : str
        All files are inside it; it is made if it is not there.
    name : str
        Relative to the folder, or an absolute path inside it.
    parameter : str
        What sets the folder, for messages.

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
