# SPDX-License-Identifier: BSD-3-Clause
"""The machine as the checks see it; tests replace it."""
from __future__ import annotations

import importlib.util
import os
import shutil
import socket
import subprocess
import sys
import tempfile
from typing import List, Optional, Set, Tuple

_LISTENS = "0A"             # state TCP_LISTEN of Linux, as /proc/net/tcp writes it


class Machine:
    """Information about this machine and this process; every method returns within a few seconds.

    Attributes
    ----------
    environ : dict
        Environment variables.
    python : str
        The interpreter that runs this.
    version : tuple of int
        Its version.
    folder : str
        The current folder.
    """

    def __init__(self) -> None:
        self.environ = dict(os.environ)
        self.python, self.version = sys.executable, tuple(sys.version_info[:3])
        self.folder = os.getcwd()

    def which(self, program: str) -> Optional[str]:
        """Return the path of a program on PATH, or None."""
        return shutil.which(program, path=self.environ.get("PATH"))

    def has_module(self, name: str) -> bool:
        """Return whether a Python module can be found; it is not imported."""
        try:
            return importlib.util.find_spec(name) is not None
        except (ImportError, ValueError):
            return False

    def run(self, arguments: List[str], patience: float = 10.0) -> Tuple[Optional[int], str]:
        """Run a program.

        Parameters
        ----------
        arguments : list of str
            The command.
        patience : float
            Time limit [s of wall time].

        Returns
        -------
        (int or None, str)
            Its exit code, None if it cannot be run or takes too long, and its output.
        """
        try:
            done = subprocess.run(arguments, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                  env=self.environ, timeout=patience)
        except (OSError, subprocess.TimeoutExpired) as error:
            return None, str(error)
        return done.returncode, done.stdout.decode(errors="replace")

    def exists(self, path: str) -> bool:
        """Return whether there is a file or folder."""
        return os.path.exists(path)

    def executable(self, path: str) -> bool:
        """Return whether a file may be executed."""
        return os.access(path, os.X_OK)

    def first_line(self, path: str) -> bytes:
        """Return the first line of a file with its line end, as bytes; empty if it cannot be read."""
        try:
            with open(path, "rb") as stream:
                return stream.readline(300)
        except OSError:
            return b""

    def lines(self, path: str) -> List[str]:
        """Return the lines of a text file; OSError if it cannot be read."""
        with open(path) as stream:
            return stream.readlines()

    def open_to_all(self) -> Set[int]:
        """Return the ports at which this machine's processes accept TCP connections from any address."""
        found: Set[int] = set()
        for path, everywhere in (("/proc/net/tcp", "0" * 8), ("/proc/net/tcp6", "0" * 32)):
            try:
                rows = self.lines(path)[1:]
            except OSError:
                continue                # no Linux, or no IPv6
            for row in rows:
                local, state = row.split()[1], row.split()[3]
                address, port = local.split(":")
                if state == _LISTENS and address == everywhere:
                    found.add(int(port, 16))
        return found

    def below(self, folder: str) -> List[str]:
        """Return the paths of all files below a folder."""
        return [os.path.join(where, name) for where, _, names in os.walk(folder) for name in names]

    def writable(self, folder: str) -> bool:
        """Return whether a file can be made in a folder, which may not exist yet."""
        while folder and not os.path.isdir(folder):
            if os.path.exists(folder) or os.path.dirname(folder) == folder:
                return False
            folder = os.path.dirname(folder)
        try:
            with tempfile.TemporaryFile(dir=folder or "."):
                return True
        except OSError:
            return False

    def free_bytes(self, folder: str) -> Optional[int]:
        """Return the free space on the disk of a folder, which may not exist yet; None if it is not known."""
        while folder and not os.path.isdir(folder) and os.path.dirname(folder) != folder:
            folder = os.path.dirname(folder)
        try:
            return shutil.disk_usage(folder or ".").free
        except OSError:
            return None

    def host_name(self) -> str:
        """Return the name of this machine."""
        return socket.gethostname()

    def addresses(self, host: str) -> List[str]:
        """Return the addresses of a host name; none if it cannot be resolved."""
        try:
            return sorted({entry[4][0] for entry in socket.getaddrinfo(host, None, 0, socket.SOCK_STREAM)})
        except (OSError, UnicodeError):
            return []

    def is_local(self, address: str) -> bool:
        """Tell whether an address is one of this machine's."""
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        try:
            with socket.socket(family, socket.SOCK_STREAM) as probe:
                probe.bind((address, 0))
                return True
        except OSError:
            return False

    def accepts(self, host: str, port: int, patience: float = 2.0) -> bool:
        """Return whether a server accepts connections there.

        Parameters
        ----------
        host : str
            Name or address.
        port : int
            TCP port.
        patience : float
            Time limit [s of wall time].
        """
        try:
            socket.create_connection((host, port), patience).close()
            return True
        except (OSError, OverflowError, UnicodeError):
            return False

    def accepts_unix(self, path: str) -> bool:
        """Return whether a server accepts connections at a Unix socket, in the file system or abstract."""
        for name in (path, "\0" + path):
            try:
                with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
                    probe.settimeout(2.0)
                    probe.connect(name)
                    return True
            except OSError:
                continue
        return False
