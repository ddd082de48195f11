#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Studies on a cluster of Dask whose scheduler, workers and client are killed at random moments.

As a program: python3 cluster_kills.py --kills 30 --seed 1. It fails if a stored run is lost or changed, or differs
from the same run in the fork pool. All processes are in groups of their own, and each wait has an end.
"""
import argparse
import os
import random
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
from contextlib import closing

LIMIT = 900.0       # s for one study
WORKERS = 2
MEASURED = ("wall", "cpu", "cpu_ms", "finished")
STUDY = """
study: kills
seed: {seed}
repeats: {repeats}
limit: 4
worlds: [{{file: world02, start: [0, 8], goal: [0, 7]}}, {{file: world02, start: [0, 8], goal: [0, 6.5]}}]
methods: [bug0, follow_the_gap]
"""
#: Small batches, so that a study lasts for several kills.
CLIENT = "import sys; from m2wr_campaign.runner import cluster, command; cluster.LARGEST_BATCH = 4; " \
    "sys.exit(command.main(sys.argv[1:]))"


def free_port():
    """Return a port of 127.0.0.1 that no process has now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Part:
    """A process with its children, in a group of its own."""

    def __init__(self, name, words, folder):
        self.name, self._words, self._folder, self.process = name, words, folder, None

    def start(self):
        with open(os.path.join(self._folder, self.name + ".log"), "ab") as log:
            self.process = subprocess.Popen([sys.executable, *self._words], cwd=self._folder, stdin=subprocess.DEVNULL,
                                            stdout=log, stderr=log, start_new_session=True)

    def kill(self):
        if self.process is not None:
            try:
                os.killpg(self.process.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
            self.process.wait()

    def code(self):
        """Return the exit code, or None while it runs."""
        return self.process.poll()

    def log(self):
        with open(os.path.join(self._folder, self.name + ".log"), errors="replace") as file:
            return file.read()[-3000:]


class Cluster:
    """A scheduler and workers of Dask on this machine; leaving the context kills all of them."""

    def __init__(self, folder):
        self.address = "tcp://127.0.0.1:{}".format(free_port())
        host, port = ["--host", "127.0.0.1", "--no-dashboard"], self.address.rsplit(":", 1)[1]
        self.parts = [Part("scheduler", ["-m", "distributed.cli.dask_scheduler", "--port", port] + host, folder)] + [
            Part("worker%d" % k, ["-m", "distributed.cli.dask_worker", self.address, "--nthreads", "1", "--no-nanny",
                                  "--local-directory", folder] + host, folder) for k in range(WORKERS)]

    def __enter__(self):
        for part in self.parts:
            part.start()
        return self

    def __exit__(self, *_):
        for part in self.parts:
            part.kill()

    def keep_running(self):
        """Start again what has ended: a worker ends itself without a scheduler."""
        for part in self.parts:
            if part.code() is not None:
                part.start()


def stored(path):
    """Return the runs of a results file without what is measured, by their keys."""
    if not os.path.exists(path):
        return {}
    with closing(sqlite3.connect(path, timeout=LIMIT)) as data:
        data.row_factory = sqlite3.Row
        if not data.execute("SELECT count(*) FROM sqlite_master WHERE name = 'runs'").fetchone()[0]:
            return {}
        return {row["key"]: {name: row[name] for name in row.keys() if name not in MEASURED}
                for row in data.execute("SELECT * FROM runs")}


def assert_kept(before, after):
    """Fail if a run that was stored is not there any more, or is another one."""
    lost = [key for key, row in before.items() if after.get(key) != row]
    assert not lost, "{} of {} stored runs are lost or changed".format(len(lost), len(before))


class Killer:
    """Kills parts at random moments, some stored runs after the last kill and then some time later."""

    def __init__(self, seed, names, most_runs, most_pause):
        self._random, self._most = random.Random(seed), (most_runs, most_pause)
        self.left, self.done = list(names), []
        self._plan(0)

    def _plan(self, count):
        self._count, self._since = count + self._random.randint(1, self._most[0]), None
        self._pause = self._random.uniform(0.0, self._most[1])

    def begin(self):
        """Begin with a new study."""
        self._plan(0)

    def look(self, path, parts):
        """Kill a part if its moment has come."""
        if not self.left:
            return
        before = stored(path)
        if len(before) >= self._count and self._since is None:
            self._since = time.monotonic()
        if self._since is None or time.monotonic() - self._since < self._pause:
            return
        name = self.left.pop(0)
        part = self._random.choice([part for part in parts if part.name.startswith(name)])
        part.kill()
        after = stored(path)
        assert_kept(before, after)
        self.done.append((part.name, len(after)))
        self._plan(len(after))


def run_study(folder, number, repeats, killer, cluster):
    """Run a study to its end with kills on the way; return the path of its results."""
    study, path = (os.path.join(folder, "study{}.{}".format(number, end)) for end in ("yaml", "sqlite"))
    with open(study, "w") as file:
        file.write(STUDY.format(seed=number, repeats=repeats))
    client = Part("client", ["-c", CLIENT, study, "--out", path, "--scheduler", cluster.address], folder)
    killer.begin()
    until = time.monotonic() + LIMIT
    client.start()
    try:
        while client.code() != 0:
            assert time.monotonic() < until, "no end after {} s: {}".format(LIMIT, client.log())
            cluster.keep_running()
            if client.code() is not None:
                client.start()
            killer.look(path, cluster.parts + [client])
            time.sleep(0.02)
    finally:
        client.kill()
    assert len(stored(path)) == 4 * repeats, client.log()
    return study, path


def assert_like_in_the_pool(study, path):
    """Fail if a row differs from that of the fork pool."""
    other = path + ".pool"
    subprocess.run([sys.executable, "-c", CLIENT, study, "--out", other], check=True, timeout=LIMIT,
                   stdout=subprocess.DEVNULL)
    assert stored(path) == stored(other)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--repeats", type=int, default=25, help="a quarter of the runs of a study")
    options = parser.parse_args()
    names = [random.Random(options.seed + k).choice(["scheduler", "worker", "client"]) for k in range(options.kills)]
    killer, number, total = Killer(options.seed, names, 12, 2.0), 0, 0
    folder = tempfile.mkdtemp(prefix="m2wr_kills_")
    try:
        with Cluster(folder) as cluster:
            while killer.left:
                number += 1
                study, path = run_study(folder, number, options.repeats, killer, cluster)
                assert_like_in_the_pool(study, path)
                total += len(stored(path))
                print("study {}: {} runs; kills so far: {}".format(number, len(stored(path)), killer.done), flush=True)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print("{} kills in {} studies of {} runs: no stored run was lost, all rows as in the fork pool".format(
        len(killer.done), number, total))


if __name__ == "__main__":
    main()
