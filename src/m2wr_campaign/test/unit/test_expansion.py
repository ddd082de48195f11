# SPDX-License-Identifier: BSD-3-Clause
"""A study gives the same runs, with the same keys and seeds, in every process."""
import math
import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
import rospkg

from m2wr_campaign.study.content import content_of
from m2wr_campaign.study.expansion import all_tasks, balanced, with_noise
from m2wr_campaign.study.fields import StudyError
from m2wr_campaign.study.study_file import read_study
from m2wr_sim.api import read_robot
from m2wr_sim.model.types import Heightmap

TEXT = "study: one\nseed: {}\nrepeats: 2\nworlds: [{{file: world02, start: [0, 8], goal: [0, -4]}}, " \
    "{{generator: maze, count: 2, parameters: {{cells: 3}}}}]\nmethods: [bug2, dwa]\nnoise: [0.0, 0.02]\n"
M2WR = os.path.join(rospkg.RosPack().get_path("m2wr_description"), "urdf", "m2wr.xacro")
POST = "v 4 0 0\nv 5 0 0\nv 4 1 0\nv 4 0 {}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
WORLD = "<sdf version='1.6'><world name='w'><model name='post'><static>true</static><link name='l'>" \
    "<collision name='c'><geometry><mesh><uri>file://{}/post.obj</uri></mesh></geometry></collision></link></model>" \
    "</world></sdf>"


def tasks(tmp_path, text, *kept):
    (tmp_path / "s.yaml").write_text(text)
    return all_tasks(read_study(str(tmp_path / "s.yaml")), *kept)


def test_each_run_has_its_own_key(tmp_path):
    one, two = tasks(tmp_path, TEXT.format(3)), tasks(tmp_path, TEXT.format(3))
    assert [(task.key, task.seed) for task in one] == [(task.key, task.seed) for task in two]
    assert len({task.key for task in one}) == len(one) == 3 * 2 * 2 * 2
    other = tasks(tmp_path, TEXT.format(4))
    assert not {task.key for task in one} & {task.key for task in other}


def test_patience_makes_other_runs_and_none_leaves_them(tmp_path):
    one = tasks(tmp_path, TEXT.format(3))
    patient = tasks(tmp_path, "patience: 30\n" + TEXT.format(3))
    assert {task.patience for task in patient} == {30.0} and {task.patience for task in one} == {math.inf}
    assert not {task.key for task in one} & {task.key for task in patient}
    assert [task.seed for task in one] == [task.seed for task in patient]
    assert [replace(task, patience=math.inf).key for task in patient] == [task.key for task in one]


def test_keys_do_not_depend_on_the_place_of_files(tmp_path):
    text = TEXT.replace("file: world02", "file: one.world") + "robots: [one.xacro]\n"
    keys = []
    for name, top in (("here", 0.5), ("there", 0.5), ("other", 0.6)):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "one.world").write_text(WORLD.format(folder))
        (folder / "post.obj").write_text(POST.format(top))
        shutil.copy(M2WR, folder / "one.xacro")
        keys.append([task.key for task in tasks(folder, text.format(3)) if task.world.kind == "file"])
    assert len(keys[0]) == 8 and keys[0] == keys[1] and not set(keys[0]) & set(keys[2])


def test_contents_of_arrays_count_wholly():
    heights = np.zeros((100, 100))
    other = heights.copy()
    other[50, 50] = 1e-9
    one, same, two = (content_of(Heightmap(array, source=name)) for array, name in (
        (heights, "a.png"), (heights.copy(), "b.png"), (other, "a.png")))
    assert one == same != two
    with pytest.raises(TypeError, match="a set in a model"):
        content_of(({1},))


def test_only_methods_share_a_seed(tmp_path):
    seeds = {}
    for task in tasks(tmp_path, TEXT.format(3)):
        seeds.setdefault((task.world.key, task.noise, task.repeat), set()).add(task.seed)
    assert len(seeds) == len(set.union(*seeds.values())) == 3 * 2 * 2 and all(len(some) == 1 for some in seeds.values())


def test_a_run_keeps_its_key_when_factors_are_added(tmp_path):
    before = {task.key for task in tasks(tmp_path, TEXT.format(3))}
    more = TEXT.format(3).replace("bug2, dwa", "bug1, bug2, dwa").replace("count: 2", "count: 3")
    assert before < {task.key for task in tasks(tmp_path, more.replace("repeats: 2", "repeats: 3"))}


def test_the_first_runs_are_a_smaller_study_of_all_kinds(tmp_path):
    order = balanced(tasks(tmp_path, TEXT.format(3) + "robots: [m2wr]\n"))
    assert [(task.repeat, task.world.number) for task in order] == sorted(
        (task.repeat, task.world.number) for task in order)
    first = order[:2 * 2 * 2]                               # kinds, methods, noise
    assert {(task.world.kind, task.method.name, task.noise) for task in first} == {
        (kind, method, noise) for kind in ("file", "maze") for method in ("bug2", "dwa") for noise in (0.0, 0.02)}


def test_worlds_that_were_generated_are_not_made_again(tmp_path, monkeypatch):
    first = tasks(tmp_path, TEXT.format(3))
    known = {task.world.recipe: task.world for task in first if task.world.recipe}
    monkeypatch.setattr("m2wr_campaign.study.expansion.generate", lambda *given: pytest.fail("it generated"))
    again = tasks(tmp_path, TEXT.format(3), known.get)
    assert len(known) == 2 and [task.key for task in again] == [task.key for task in first]


@pytest.mark.parametrize("before, after, told", [
    ("file: world02", "file: no_such", "s.yaml: worlds[0]: world \"no_such\": there is no such file"),
    ("noise", "robots: [no_such.urdf]\nnoise", "s.yaml: robots[0]: robot \"no_such.urdf\""),
    ("cells: 3", "cells: 3, width: 0.4", "generator maze with cells 3, opened 0.1, width 0.4: no way for a disc of"),
    ("[{file", "[{file: world02, start: [0, 8], goal: [0, -4]}, {file", "world02 with m2wr occurs twice"),
])
def test_what_cannot_be_run_is_told(tmp_path, before, after, told):
    with pytest.raises(StudyError) as error:
        tasks(tmp_path, TEXT.format(0).replace(before, after))
    assert told in str(error.value)


def test_noise_replaces_that_of_the_description():
    sensors = [sensor for link in with_noise(read_robot("m2wr"), 0.03).links for sensor in link.sensors if sensor.ray]
    assert sensors and all(sensor.ray.noise.stddev == 0.03 for sensor in sensors)
    quiet = [sensor for link in with_noise(read_robot("m2wr"), 0.0).links for sensor in link.sensors if sensor.ray]
    assert all(sensor.ray.noise.kind == "none" for sensor in quiet)
