# SPDX-License-Identifier: BSD-3-Clause
"""The parts of .ci/run that need no root: settings passed in, exit code, last line."""
import os
import subprocess

import workspace_tree as tree

SOURCE = 'source "$1/tools/common.sh"; source "$1/tools/fresh_root.sh"; shift; '


def bash(script, *arguments, text="", **variables):
    """Run a script with the functions of the tools; returns its output."""
    done = subprocess.run(["bash", "-c", SOURCE + script, "bash", tree.ROOT] + list(arguments), input=text, check=True,
                          env=dict(os.environ, **variables), stdout=subprocess.PIPE,
                          universal_newlines=True, timeout=60)
    return done.stdout


def test_only_existing_paths_in_settings_are_used(tmp_path):
    index, wheels = tmp_path / "simple", tmp_path / "wheels"
    index.mkdir()
    wheels.mkdir()
    text = "extra-index-url = file://%s file:///not/there\nfind-links=%s\nindex-url = https://a/b\n" % (index, wheels)
    assert bash("named_paths", text=text).split() == [str(index), str(wheels)]


def test_settings_files_are_merged_and_the_last_value_counts():
    text = "[global]\ncert = /a\nextra-index-url =\n    x\n    y\n# c\n[install]\nno-deps = 1\n\n[global]\ncert = /b\n"
    assert bash("merge_sections", text=text).splitlines() == [
        "[global]", "cert = /b", "extra-index-url =", "    x", "    y", "[install]", "no-deps = 1"]


def test_only_variables_of_pip_proxies_and_make_are_passed(tmp_path):
    bundle = tmp_path / "ca.pem"
    bundle.write_text("")
    lines = bash("handed_variables", PIP_EXTRA_INDEX_URL="https://a/simple", PIP_CERT=str(bundle),
                 https_proxy="http://p:1", TEST_PACKAGES="m2wr_sim motion_plan", PYTHONPATH="/x",
                 HOME=str(tmp_path)).splitlines()
    assert {"PIP_EXTRA_INDEX_URL=https://a/simple", "https_proxy=http://p:1", "TEST_PACKAGES=m2wr_sim motion_plan",
            "PIP_CERT=/etc/ssl/handed-in-ca.crt"} <= set(lines)
    assert not [line for line in lines if line.startswith(("PYTHONPATH", "HOME", "PATH"))]
    assert len([line for line in lines if line.startswith("PIP_CERT=")]) == 1


def test_the_checkout_is_copied_without_what_builds_have_written(tmp_path):
    source, target = tmp_path / "source", tmp_path / "target"
    for name in ("devel/x", ".venv/x", "catkin_build/x", "src/a b", "src/__pycache__/x"):
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_text("")
    bash('WORKSPACE=$1; copy_checkout "$2"', str(source), str(target))
    assert sorted(str(path.relative_to(target)) for path in target.rglob("*") if path.is_file()) == ["src/a b"]


def workspace(tmp_path, recipes):
    """A workspace with the tools and a Makefile of its own."""
    (tmp_path / "tools").mkdir()
    for name in ("ci.sh", "common.sh", "fresh_root.sh"):
        (tmp_path / "tools" / name).write_bytes(open(os.path.join(tree.ROOT, "tools", name), "rb").read())
    (tmp_path / "Makefile").write_text("".join("%s:\n\t%s\n" % entry for entry in recipes.items()))
    return ["bash", str(tmp_path / "tools/ci.sh")]


def run(command, **variables):
    return subprocess.run(command, env=dict(os.environ, CI_STEPS="", **variables), stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, universal_newlines=True, timeout=60)


def test_on_the_host_a_warning_gives_the_reason(tmp_path):
    command = workspace(tmp_path, {
        "setup": "true", "lint": "true", "docs": "true", "demo": "true",
        "test": "mkdir -p test_results; echo 7 passed, 0 failed, 0 skipped > test_results/summary.txt"})
    done = run(command, CI_ROOT="host")
    assert done.returncode == 0, done.stdout
    assert "WARNING: no fresh root: CI_ROOT=host" in done.stdout and "do not prove" in done.stdout
    assert done.stdout.splitlines()[-1] == "7 passed, 0 failed, 0 skipped"


def test_the_exit_code_is_that_of_the_failed_step(tmp_path):
    command = workspace(tmp_path, {"setup": "true", "lint": "exit 3", "test": "echo > tested", "demo": "true"})
    (tmp_path / "test_results").mkdir()
    (tmp_path / "test_results/summary.txt").write_text("9 passed, 0 failed, 0 skipped\n")
    done = run(command, CI_ROOT="host")
    assert done.returncode == 2 and "make lint: FAILED" in done.stdout      # make's own exit code
    assert done.stdout.splitlines()[-1] == "the tests did not run" and not (tmp_path / "tested").exists()
