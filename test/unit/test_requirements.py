# SPDX-License-Identifier: BSD-3-Clause
"""PyPI packages are pinned to versions and to the hashes of their files, and set-up installs no others."""
import glob
import os
import re
import subprocess
import zipfile

import pytest

import workspace_tree as tree

TOOLS = os.path.join(tree.ROOT, "tools")
FILES = sorted(glob.glob(os.path.join(TOOLS, "requirements*.txt")))
PIN = re.compile(r"([A-Za-z0-9._-]+==[0-9][A-Za-z0-9.]*) \\")
HASH = re.compile(r"    --hash=sha256:([0-9a-f]{64})( \\)?")


def read(path):
    """Return {pin: set of hashes}; a line of another form fails."""
    found, pin = {}, None
    with open(path) as stream:
        for number, line in enumerate(stream, 1):
            if line.startswith("#"):
                continue
            line = line.rstrip("\n")
            if PIN.fullmatch(line):
                pin = line.split(" ")[0]
                assert pin not in found
                found[pin] = set()
            else:
                match = HASH.fullmatch(line)
                assert match and pin, "%s:%d: %r is neither a pinned version nor a hash" % (path, number, line)
                found[pin].add(match.group(1))
    return found


@pytest.mark.parametrize("path", FILES, ids=os.path.basename)
def test_every_package_has_one_version_and_hashes(path):
    found = read(path)
    assert found and all(found.values()), "no hashes: %s" % [pin for pin, hashes in found.items() if not hashes]


def test_the_same_version_has_the_same_hashes_in_all_files():
    found = {}
    for path in FILES:
        for pin, hashes in read(path).items():
            found.setdefault(pin, []).append(hashes)
    assert len(found["rosbags==0.9.23"]) == 2
    assert all(hashes == several[0] for several in found.values() for hashes in several)


def pins(path):
    """Return the pins that the scripts read from a file."""
    done = subprocess.run(["bash", "-c", 'source "$1/common.sh"; pins "$2"', "bash", TOOLS, path], check=True,
                          stdout=subprocess.PIPE, universal_newlines=True, timeout=30)
    return done.stdout.split()


@pytest.mark.parametrize("path", FILES, ids=os.path.basename)
def test_scripts_read_the_same_versions(path):
    assert pins(path) == list(read(path))


def wheel(folder):
    """Write a tiny wheel; returns its path."""
    path = folder / "thing-1.0-py3-none-any.whl"
    with zipfile.ZipFile(str(path), "w") as archive:
        archive.writestr("thing.py", "")
        archive.writestr("thing-1.0.dist-info/METADATA", "Metadata-Version: 2.1\nName: thing\nVersion: 1.0\n")
        archive.writestr("thing-1.0.dist-info/WHEEL",
                         "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr("thing-1.0.dist-info/RECORD", "")
    return path


@pytest.mark.parametrize("wrong", ["0" * 64, None])
def test_setup_refuses_a_file_with_another_hash_or_none(tmp_path, wrong):
    with open(os.path.join(TOOLS, "venv.sh")) as stream:
        command = re.search(r"-m (pip .*?-r) ", stream.read().replace("\\\n", ""), re.S).group(1).split()
    wheel(tmp_path)
    requirements = tmp_path / "requirements.txt"
    requirements.write_text("thing==1.0" + (" --hash=sha256:" + wrong if wrong else "") + "\n")
    python = os.path.join(tree.ROOT, ".venv", "bin", "python")
    done = subprocess.run([python, "-m"] + command[:-1] + [
        "--no-index", "--find-links", str(tmp_path), "--target", str(tmp_path / "target"), "-r", str(requirements)],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, timeout=120)
    assert done.returncode != 0
    assert ("DO NOT MATCH" if wrong else "Hashes are required") in done.stdout, done.stdout
