# SPDX-License-Identifier: BSD-3-Clause
"""The check of an exercise, as its command does it."""
from m2wr_course.command import main


def check(number, path, capsys):
    code = main([str(number), str(path)])
    return code, capsys.readouterr()
