"""Starting a node so that signals always end it."""
import signal
import sys
import threading

import rospy


def shut_down_beside():
    """Let SIGINT, SIGTERM and, where nohup does not ignore it, SIGHUP shut ROS down on a thread of its own.

    rospy does it inside the signal, on the thread that may be publishing, or registering, at that very moment and then
    waits for ever for a lock that it holds itself.
    """
    def on_signal(number, _):
        threading.Thread(target=rospy.signal_shutdown, args=("signal-%d" % number,)).start()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, on_signal)


def start_node(name, **options):
    """Register the node ``name``, with options of ``rospy.init_node``; exits with 1 if it is interrupted meanwhile."""
    shut_down_beside()
    try:
        rospy.init_node(name, disable_signals=True, **options)      # may wait for a master
    except Exception:                   # of whatever kind: what it was doing was closed under it
        if not rospy.core.is_shutdown_requested():
            raise
        sys.exit(1)
