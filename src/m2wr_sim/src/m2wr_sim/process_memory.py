# SPDX-License-Identifier: BSD-3-Clause
"""Memory use of a process, from the operating system."""
from typing import Union

_KILOBYTES = 1024.0     # a megabyte of this module


def memory_mb(name: str, pid: Union[int, str] = "self") -> float:
    """Return a figure of a process's memory [MB], 0 if the system does not report it.

    ``resource.getrusage`` is not used: its peak includes that of the parent process.

    Parameters
    ----------
    name : str
        A field of ``/proc/PID/status`` (proc(5)): ``VmRSS``, memory in use, or ``VmHWM``, its peak.
    pid : int or str
        Process id, or ``self``.
    """
    try:
        with open("/proc/%s/status" % pid, encoding="utf-8") as stream:
            for line in stream:
                field, _, value = line.partition(":")
                if field == name:
                    return int(value.split()[0]) / _KILOBYTES
    except OSError:
        pass
    return 0.0
