"""Starting a node so that signals always end it."""
import signal
import socket
import sys
import threading
import time

import rosgraph
import rosgraph.network
import rosgraph.rosenv
import rospy

from m2wr_view.ros.acceptor import accept_side_by_side

LOOK = 0.2              # between two looks for a master [s], wall
PATIENCE = 2.0          # a master that is there takes a connection within that time [s], wall


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


def wait_for_master(name):
    """Return once the master takes connections; exits with 1 if a signal comes before.

    rospy waits as well, but with a lock held that its own end needs: who had forgotten roscore could not stop it.
    Exits with 1, too, where ROS_MASTER_URI is no address: rospy would try it for ever.
    """
    uri = rosgraph.get_master_uri() or rosgraph.rosenv.DEFAULT_MASTER_URI       # empty: as rospy takes it
    try:
        address = rosgraph.network.parse_http_host_and_port(uri)
        address[0].encode("idna")
    except ValueError as error:
        sys.stderr.write("%s: ROS_MASTER_URI is %r (%s); expected http://HOST:PORT\n" % (name, uri, error))
        sys.exit(1)
    told = False
    while not rospy.core.is_shutdown_requested():
        try:
            socket.create_connection(address, PATIENCE).close()
            return
        except (OSError, OverflowError):
            if not told:
                sys.stderr.write("%s: no master answers at %s yet; waiting for roscore or roslaunch\n" % (name, uri))
                sys.stderr.flush()
            told = True
            time.sleep(LOOK)
    sys.exit(1)


def start_node(name, **options):
    """Register the node ``name``, with options of ``rospy.init_node``; exits with 1 if it is interrupted meanwhile."""
    shut_down_beside()
    wait_for_master(name)
    try:
        rospy.init_node(name, disable_signals=True, **options)
    except Exception:                   # of whatever kind: what it was doing was closed under it
        if not rospy.core.is_shutdown_requested():
            raise
        sys.exit(1)
    accept_side_by_side()
