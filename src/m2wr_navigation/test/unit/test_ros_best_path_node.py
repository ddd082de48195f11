# SPDX-License-Identifier: BSD-3-Clause
"""What ``best_path`` does when it ends, without a master."""
import threading
from types import SimpleNamespace

from m2wr_navigation.ros.best_path_node import BestPathNode


def test_no_command_follows_the_last_one():
    node, sent = object.__new__(BestPathNode), []
    node.__dict__.update(_lock=threading.RLock(), _closed=False, _driver=object(), explores=False, _ended="",
                         _saved=True, _commands=SimpleNamespace(publish=sent.append))
    node._command(0.5, 0.1)
    node._close()
    node._command(0.5, 0.1)         # of a cycle that has just been computed
    assert [(message.linear.x, message.angular.z) for message in sent] == [(0.5, 0.1), (0.0, 0.0)]
