"""Writing files so that each is there as a whole or as it was before, whatever happens meanwhile."""
import os
import tempfile

STREAMS = ("/dev/stdout", "/dev/stderr", "/dev/fd/", "/proc/self/fd/")


def write_whole(*files):
    """Write files; all are complete on the disk before the first takes the place of an older one.

    A link stays one: the file that it leads to is replaced. Devices, pipes and the program's own streams are written
    to, not replaced.

    Parameters
    ----------
    files : tuple of (str, sequence)
        Path, and parts: bytes or what can be written like them.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    waiting, folders = [], set()
    try:
        for path, parts in files:
            if _is_stream(path):
                with open(path, "ab") as stream:
                    _put(stream, parts)
                continue
            path = os.path.realpath(path)
            folders.add(os.path.dirname(path))
            waiting.append((_complete(os.path.dirname(path), parts), path))
        for temporary, path in list(waiting):
            os.replace(temporary, path)
            waiting.remove((temporary, path))
        for folder in folders:
            _sync(folder)
    finally:
        for temporary, _ in waiting:
            _remove(temporary)


def _is_stream(path):
    path = os.path.abspath(path)
    return path.startswith(STREAMS) or (os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path))


def _put(stream, parts):
    for part in parts:
        stream.write(part)
    stream.flush()


def _complete(folder, parts):
    """Write parts into a temporary file in ``folder`` and onto the disk; return its path."""
    descriptor, path = tempfile.mkstemp(prefix=".whole-", dir=folder)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            _put(stream, parts)
            os.fsync(stream.fileno())
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(path, 0o666 & ~mask)
    except BaseException:
        _remove(path)
        raise
    return path


def _remove(path):
    try:
        os.unlink(path)
    except OSError:
        pass            # it is gone already, which is what is wanted


def _sync(folder):
    """Put a folder's names onto the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
