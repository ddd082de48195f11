# SPDX-License-Identifier: BSD-3-Clause
"""The workflow, the Dockerfile, the dev container and the hooks run the commands of README and Makefile."""
import json
import os
import re

import yaml

import workspace_tree as tree

#: What the fresh root of .ci/run has beside a minimal Debian; ca-certificates are handed in there.
BEGIN = "apt-get update && apt-get install -y --no-install-recommends ca-certificates git make"


def text_of(*parts):
    return tree.read(os.path.join(tree.ROOT, *parts))


def two_commands():
    """Return the commands of the README's first block."""
    section = text_of("README.md").split("## Two commands")[1].split("\n## ")[0]
    return re.findall(r"^(make \w+)", section.split("```bash")[1].split("```")[0], re.M)


def workflow():
    return yaml.safe_load(text_of(".github", "workflows", "ci.yml"))["jobs"]["debian12"]


def test_readme_has_two_commands():
    assert two_commands() == ["make demo", "make test"]


def test_workflow_runs_the_two_commands_in_debian_12():
    commands = [step["run"] for step in workflow()["steps"] if "run" in step]
    assert workflow()["container"] == "debian:12"
    assert commands[0] == BEGIN and commands[1:3] == two_commands()


def test_workflow_uploads_what_the_two_commands_write():
    upload = [step for step in workflow()["steps"] if "upload-artifact" in step.get("uses", "")][0]
    assert upload["if"] == "always()"
    for folder in upload["with"]["path"].split():
        assert folder in two_commands_text() and "/" + folder in text_of(".gitignore")


def two_commands_text():
    return text_of("README.md").split("## Two commands")[1].split("\n## ")[0]


def test_image_and_dev_container_begin_as_the_workflow():
    image = text_of("Dockerfile")
    container = json.loads(text_of(".devcontainer", "devcontainer.json"))
    assert re.findall(r"^FROM (.*)$", image, re.M) == [container["image"]] == [workflow()["container"]]
    runs = re.findall(r"^RUN (.*)$", image, re.M)
    assert runs[:2] == [container["onCreateCommand"], container["postCreateCommand"]] == [BEGIN, two_commands()[0]]


def test_containers_open_on_the_live_view_at_a_forwarded_port():
    container = json.loads(text_of(".devcontainer", "devcontainer.json"))
    command = json.loads(re.search(r"^CMD (.*)$", text_of("Dockerfile"), re.M).group(1))
    port, = container["forwardPorts"]
    assert command[0] == container["postAttachCommand"] and os.access(os.path.join(tree.ROOT, command[0]), os.X_OK)
    assert "live:=true" in text_of(command[0]) and "live_host:=0.0.0.0" in command
    assert "EXPOSE %d\n" % port in text_of("Dockerfile") and "live_port:=%d" % port in command
    assert list(container["portsAttributes"]) == [str(port)]
    address = text_of("src", "m2wr_node", "src", "m2wr_node", "listening.py")
    first = re.search(r"^FIRST_PORT, .* = (\d+)", address, re.M)
    assert port == int(first.group(1))


def test_image_leaves_out_what_git_ignores():
    ignored = {line.strip("/") for line in text_of(".gitignore").splitlines() if re.match(r"/[\w.]+/$", line)}
    left_out = [line for line in text_of(".dockerignore").splitlines() if not line.startswith("#")]
    assert [name for name in sorted(ignored) if not any(
        re.fullmatch(pattern.replace(".", r"\.").replace("*", ".*"), name) for pattern in left_out)] == []


def test_fresh_root_begins_with_the_same_packages():
    included = re.search(r"--include=([\w,]+)", text_of("tools", "fresh_root.sh")).group(1).split(",")
    assert set(included) <= set(BEGIN.split()) | {"sudo"}


def test_commands_are_targets_of_the_makefile():
    steps = [step.get("run", "") for step in workflow()["steps"]]
    for target in re.findall(r"make (\w+)$", "\n".join(steps), re.M):
        assert re.search(r"^%s:" % target, text_of("Makefile"), re.M)


def test_hooks_run_checks_that_exist():
    hooks = {hook["id"]: hook["entry"].split()
             for hook in yaml.safe_load(text_of(".pre-commit-config.yaml"))["repos"][0]["hooks"]}
    assert set(hooks) == {"lint", "subject"}
    for entry in hooks.values():
        assert os.access(os.path.join(tree.ROOT, entry[0]), os.X_OK)
    for check in hooks["lint"][1:]:
        assert "\nlint_%s() {" % check in text_of("tools", "lint.sh")
