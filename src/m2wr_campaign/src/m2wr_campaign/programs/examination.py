# SPDX-License-Identifier: BSD-3-Clause
"""A run of a ROS program, seen from the process that has the task: an examiner of its own does it."""
from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from multiprocessing import Pipe
from typing import TYPE_CHECKING, Any, Dict

from m2wr_campaign.programs.warden import end_all

if TYPE_CHECKING:
    from m2wr_campaign.study.factors import RunTask

EXAMINER = "m2wr_campaign.programs.examiner"


class ExaminerLost(Exception):
    """The examiner ended without an answer."""


def examined(task: RunTask) -> Dict[str, Any]:
    """Return the row of a run of a program.

    Parameters
    ----------
    task : RunTask

    Raises
    ------
    ExaminerLost
        With how it ended; what it wrote is on standard error.
    """
    pipe, far = Pipe()
    folder = tempfile.mkdtemp(prefix="m2wr_examiner_")      # of its temporary files: removed also if it is killed
    os.chmod(folder, 0o711)                                 # the program may run as another user
    with far:
        process = subprocess.Popen([sys.executable, "-m", EXAMINER, str(os.getpid()), str(far.fileno())],
                                   stdin=subprocess.DEVNULL, pass_fds=[far.fileno()],
                                   env=dict(os.environ, TMPDIR=folder))
    try:
        pipe.send(task)
        row: Dict[str, Any] = pipe.recv()
        return row
    except (EOFError, OSError):
        raise ExaminerLost("the examiner of the program ended with exit code {}".format(process.wait())) from None
    finally:
        if process.poll() is None:
            end_all(process.pid)
        process.kill()
        process.wait()
        pipe.close()
        shutil.rmtree(folder, ignore_errors=True)
