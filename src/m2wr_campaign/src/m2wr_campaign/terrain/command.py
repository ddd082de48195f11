# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_campaign terrain``: writes rough ground as a world that this simulator and Gazebo load."""
from __future__ import annotations

import argparse
import json
import os
import sys
from typing import Dict, Optional, Sequence

import numpy as np

from m2wr_campaign.terrain.files import picture, write_heightmap, write_meshes
from m2wr_campaign.terrain.measures import measures_of
from m2wr_campaign.terrain.relief import DEFAULT_HEIGHTS, PATCHES, Grid, heights_of, patches_of

_UNITS = {"rms_height": "m", "slope_median": "deg", "slope_95": "deg", "slope_max": "deg", "step_95": "m",
          "step_max": "m"}


def _reliefs(words: Sequence[str]) -> Dict[str, float]:
    """Return the heights of reliefs given as NAME or NAME=HEIGHT; raise ValueError if one is malformed."""
    found = {}
    for word in words:
        name, equals, height = word.partition("=")
        try:
            found[name] = float(height) if equals else DEFAULT_HEIGHTS.get(name, 0.0)
        except ValueError:
            raise ValueError('relief "{}"; expected NAME or NAME=HEIGHT in metres'.format(word)) from None
    return found


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="terrain", description="Write rough ground as a world in SDF.")
    parser.add_argument("reliefs", nargs="*", default=["fractal"], metavar="RELIEF", help="some of {}; each may have a "
                        "height in metres, as rubble=0.1 (default: fractal)".format(", ".join(sorted(DEFAULT_HEIGHTS))))
    parser.add_argument("--seed", type=int, default=0, help="the same seed gives the same ground (default: 0)")
    parser.add_argument("--size", type=float, default=20.0, help="of a side, in metres (default: 20)")
    parser.add_argument("--samples", type=int, default=513, help="a side, 2^n + 1 (default: 513)")
    parser.add_argument("--form", choices=("heightmap", "mesh"), help="how the ground is written (default: heightmap; "
                        "mesh if there are patches, because a heightmap has one friction)")
    parser.add_argument("--bits", type=int, choices=(8, 16), default=16, help="of the picture of heights (default: 16; "
                        "Gazebo before version 11 reads only 8)")
    parser.add_argument("--patches", nargs="*", default=[], metavar="PATCH", help="some of {}".format(", ".join(
        "{} (friction {:g})".format(name, mu) for name, mu in PATCHES.items() if name != "ground")))
    parser.add_argument("--share", type=float, default=0.3, help="of the area that has patches (default: 0.3)")
    parser.add_argument("--output", default="terrain", help="folder for the files (default: terrain)")
    return parser


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: of the command line.

    Returns
    -------
    int
        Exit code: 0, or 2 if something given is wrong or a file cannot be written.
    """
    given = _parser().parse_args(arguments)
    try:
        if given.seed < 0:
            raise ValueError("the seed is {}; expected 0 or more".format(given.seed))
        if given.form == "heightmap" and given.patches:
            raise ValueError("patches in a heightmap, which has one friction for all; expected --form mesh")
        grid = Grid(given.samples, given.size)
        heights = heights_of(grid, _reliefs(given.reliefs), given.seed)
        which = patches_of(grid, tuple(given.patches), given.share, given.seed)
        os.makedirs(given.output, exist_ok=True)
        if given.form == "mesh" or given.patches:
            paths = write_meshes(given.output, grid, heights, which, given.patches)
        else:
            paths = write_heightmap(given.output, grid, heights, given.bits)
        found = measures_of(heights, grid.cell)
        for index, name in enumerate(["ground", *given.patches]):
            found["share_" + name] = float(np.mean(which == index))
        paths += [os.path.abspath(os.path.join(given.output, name)) for name in ("terrain.png", "measures.json")]
        picture(grid, heights, which, given.patches).save(paths[-2])
        with open(paths[-1], "w", encoding="utf-8") as file:
            json.dump(found, file, indent=1)
    except (ValueError, OSError) as error:
        print("terrain: {}".format(error), file=sys.stderr)
        return 2
    for name, value in found.items():
        print("{:14} {:.4g} {}".format(name, value, _UNITS.get(name, "")).rstrip())
    print("\n".join(paths))
    return 0
