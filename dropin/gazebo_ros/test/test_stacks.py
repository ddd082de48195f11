# SPDX-License-Identifier: BSD-3-Clause
"""Stacks on a signal, while threads run."""
import signal
import subprocess
import sys

PROGRAM = '''
import signal, sys, threading
from gazebo_ros.stacks import show_stacks_on

def deep(levels):
    return [deep(levels - 1) for _ in range(2)] if levels else []

def come_and_go():
    while True:
        deep(8)
        thread = threading.Thread(target=deep, args=(4,))
        thread.start()
        thread.join()

def main_thread_is_here():
    print("ready", flush=True)
    for line in sys.stdin:
        pass

show_stacks_on(signal.SIGUSR1)
signal.signal(signal.SIGUSR2, lambda *_: print("another signal", flush=True))
for _ in range(3):
    threading.Thread(target=come_and_go, daemon=True).start()
main_thread_is_here()
print("done", flush=True)
'''
SIGNALS = 60        # if they were printed in the signal handler, the program would crash within the first ten


def test_many_signals_while_threads_come_and_go():
    with subprocess.Popen([sys.executable, '-c', PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, universal_newlines=True) as program:
        assert program.stdout.readline() == 'ready\n'
        for _ in range(SIGNALS):
            program.send_signal(signal.SIGUSR1)
            stacks = []
            while not stacks or '<module>' not in stacks[-1]:       # the outermost frame of the main thread, the last
                stacks.append(program.stderr.readline())
                assert stacks[-1], 'ended with %s' % program.wait()
            text = ''.join(stacks)
            assert 'most recent call first' in text and 'main_thread_is_here' in text and 'come_and_go' in text
        program.send_signal(signal.SIGUSR2)
        said, stacks = program.communicate()
        assert (said, program.returncode, stacks) == ('another signal\ndone\n', 0, '')
