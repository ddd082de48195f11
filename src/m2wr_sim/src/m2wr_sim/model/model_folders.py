"""From ``model://NAME`` to the SDF file of that model, on this machine's disk only."""
import os

from m2wr_sim.model.safe_xml import XmlError, parse_xml, read_file

NEWEST_SDF = (1, 7)


def parse_version(text):
    """Return an SDF version text such as ``1.6`` as a tuple (1, 6), or None if it is none."""
    try:
        numbers = tuple(int(word) for word in (text or "").strip().split("."))
    except ValueError:
        return None
    return numbers[:2] if len(numbers) >= 2 else None


def _refuse_escape(path, source):
    if os.path.isabs(path) or ".." in path.replace("\\", "/").split("/"):
        raise XmlError('{}: the path "{}" leaves the model\'s folder; expected a path below it, without ".."'.format(
            source, path))


class ModelFolders:
    """The search path for models; an instance is called with a URI.

    Parameters
    ----------
    folders : iterable of str
        Folders that hold one folder for each model, searched in this order.
    """

    def __init__(self, folders=()):
        self.folders = tuple(folder for folder in folders if folder)

    def __call__(self, uri):
        """Return the path of the SDF file that a URI stands for, or None if it is not on this machine.

        Parameters
        ----------
        uri : str
            ``model://NAME``, ``model://NAME/file.sdf`` or ``file:///absolute/path``; nothing is downloaded.

        Raises
        ------
        XmlError
            If the path contains ``..``, or the model's own model.config is malformed or names no usable file.
        """
        scheme, _, rest = uri.partition("://")
        if scheme == "model":
            rest = rest.strip("/")
            _refuse_escape(rest, uri)
            candidates = [os.path.join(folder, rest) for folder in self.folders] if rest else []
        elif scheme == "file" and os.path.isabs(rest):
            _refuse_escape(rest.lstrip("/"), uri)
            candidates = [rest]
        else:
            candidates = []
        for candidate in candidates:
            if os.path.isfile(candidate):
                return candidate
            found = _file_in_folder(candidate) if os.path.isdir(candidate) else None
            if found is not None:
                return found
        return None

    def __str__(self):
        return ", ".join(self.folders) if self.folders else "no folders"


def _file_in_folder(folder):
    """Return the newest SDF file that the folder's model.config names and this package reads, or None."""
    for name in ("model.config", "manifest.xml"):
        config = os.path.join(folder, name)
        if os.path.isfile(config):
            return _file_in_config(config, folder)
    plain = os.path.join(folder, "model.sdf")
    return plain if os.path.isfile(plain) else None


def _file_in_config(config, folder):
    root = parse_xml(read_file(config), config)
    listed = [(parse_version(element.get("version")) or (1, 0), (element.text or "").strip())
              for element in root.iter("sdf") if (element.text or "").strip()]
    usable = [entry for entry in listed if entry[0] <= NEWEST_SDF]
    if not usable:
        raise XmlError('{}: no <sdf version="..."> of at most {}.{} is listed (has {}); expected one'.format(
            config, NEWEST_SDF[0], NEWEST_SDF[1], ", ".join("{}.{}".format(*entry[0]) for entry in listed) or "none"))
    name = max(usable, key=lambda entry: entry[0])[1]
    _refuse_escape(name, config)
    path = os.path.join(folder, name)
    if not os.path.isfile(path):
        raise XmlError("{}: lists the file {}, which does not exist; expected an SDF file there".format(config, name))
    return path
