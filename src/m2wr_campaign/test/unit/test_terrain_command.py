# SPDX-License-Identifier: BSD-3-Clause
"""The command that writes rough ground: what it writes is what the simulator loads; what is wrong is named."""
import json

import numpy as np
import pytest

from m2wr_campaign.terrain.command import main
from m2wr_campaign.terrain.relief import PATCHES, Grid, heights_of, patches_of
from m2wr_sim.api import Sim, read_world

SMALL = ["--samples", "65", "--size", "8"]


def collisions(folder):
    world = read_world(str(folder / "terrain.world"))
    return {collision.name: collision for model in world.models for link in model.links
            for collision in link.collisions}


@pytest.mark.parametrize("bits", [8, 16])
def test_a_heightmap_has_the_generated_heights(tmp_path, bits, capsys):
    assert main(["fractal=0.1", "craters", "--seed", "5", "--bits", str(bits), "--output", str(tmp_path)] + SMALL) == 0
    ground = collisions(tmp_path)["ground"]
    heights = heights_of(Grid(65, 8.0), {"fractal": 0.1, "craters": 0.25}, 5)
    read = ground.geometry.heights + ground.geometry.position[2]
    assert read.shape == (65, 65) and ground.geometry.size == (8.0, 8.0)
    assert np.max(np.abs(read - heights)) < 0.51 * np.ptp(heights) / (2 ** bits - 1) + 1e-5
    assert "rms_height" in capsys.readouterr().out
    assert json.loads((tmp_path / "measures.json").read_text())["slope_max"] > 5.0


def test_level_ground_is_written_as_level(tmp_path):
    assert main(["fractal=0", "--output", str(tmp_path)] + SMALL) == 0
    ground = collisions(tmp_path)["ground"].geometry
    assert np.max(np.abs(ground.heights + ground.position[2])) < 2e-3 and np.ptp(ground.heights) == 0.0


def test_patches_are_meshes_with_their_friction(tmp_path):
    names = ["mud", "ice"]
    assert main(["fractal", "--seed", "3", "--output", str(tmp_path), "--patches"] + names + SMALL) == 0
    parts = collisions(tmp_path)
    which = patches_of(Grid(65, 8.0), tuple(names), 0.3, 3)
    for number, name in enumerate(["ground"] + names):
        assert parts[name].surface.mu == parts[name].surface.mu2 == PATCHES[name]
        assert len(parts[name].geometry.triangles) == 2 * np.sum(which == number) > 0
    assert np.mean(which > 0) == pytest.approx(0.3, abs=0.01)


@pytest.mark.parametrize("form", ["heightmap", "mesh"])
def test_a_robot_drives_on_it(tmp_path, form):
    assert main(["fractal=0.02", "--form", form, "--output", str(tmp_path)] + SMALL) == 0
    with Sim(str(tmp_path / "terrain.world"), "m2wr", pose=(0.0, 0.0, 0.3), sensing="off") as sim:
        sim.step((0.3, 0.0), 1.0)
        x, y, _ = sim.step((0.3, 0.0), 2.0).pose
        assert 0.3 < np.hypot(x, y) < 1.0


def test_the_same_seed_writes_the_same_bytes(tmp_path):
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        assert main(["rubble", "--seed", str(seed), "--output", str(tmp_path / name)] + SMALL) == 0
    one, two, three = ((tmp_path / name / "heights.png").read_bytes() for name in "abc")
    assert one == two != three


@pytest.mark.parametrize("arguments, said", [
    (["--samples", "64"], "expected 2^n + 1"), (["--samples", "20001"], "20001 samples"),
    (["--samples", "1"], "expected 2^n + 1"),
    (["--size", "nan"], "a side of nan m"), (["--size", "0"], "expected 1 to 1000 m"), (["hills"], 'no relief "hills"'),
    (["rubble=high"], "NAME=HEIGHT"), (["rubble=nan"], "0 to 10 m"), (["rubble=-1"], "0 to 10 m"),
    (["--seed", "-1"], "the seed is -1"), (["fractal", "--patches", "lava"], 'no patch "lava"'),
    (["fractal", "--patches", "mud", "--share", "2"], "0 to 1"),
    (["fractal", "--form", "heightmap", "--patches", "mud"], "one friction")])
def test_what_is_wrong_is_named(tmp_path, capsys, arguments, said):
    assert main(arguments + ["--output", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_made_is_named(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["fractal", "--output", str(tmp_path / "file")] + SMALL) == 2
    assert str(tmp_path / "file") in capsys.readouterr().err
