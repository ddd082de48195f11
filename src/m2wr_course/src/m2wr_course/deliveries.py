# SPDX-License-Identifier: BSD-3-Clause
"""Exercise 10: robots deliver every parcel to which a way leads, on higher ground."""
from __future__ import annotations

import json
from typing import Any, Iterator, Mapping

from m2wr_course.finding import Finding
from m2wr_sim.errors import WorldError

ROUGHNESS, SEED, PARCELS = 1.5, 100, 4
MOST = 1 << 20              # bytes of a file


def _read(path: str) -> Mapping[str, Any]:
    """Return the report of a run."""
    try:
        with open(path, encoding="utf-8") as stream:
            found = json.loads(stream.read(MOST))
        settings, rows = found["settings"], found["parcels"] + found["robots"]
        if not (isinstance(settings["roughness"], (int, float)) and isinstance(found["seed"], int)
                and all(isinstance(row, dict) for row in rows)):
            raise ValueError("settings, parcels or robots are not as simulate writes them")
        for row in found["parcels"]:
            row["parcel"], row["way_exists"], row["delivered"]
        for row in found["robots"]:
            row["robot"], row["end"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        said = " ".join(str(error).split())
        raise WorldError("this is no report of rosrun m2wr_delivery simulate: %s" % said) from error
    return found


def all_delivered(path: str) -> Iterator[Finding]:
    """Look at the report of a run.

    Parameters
    ----------
    path : str
        JSON of ``simulate``.

    Yields
    ------
    Finding

    Raises
    ------
    WorldError
        If it is no report.
    """
    report = _read(path)
    rough, seed = report["settings"]["roughness"], report["seed"]
    yield Finding(rough >= ROUGHNESS and seed >= SEED, "roughness %g, seed %d" % (rough, seed),
                  "run with --roughness %g or more, and a seed from %d on" % (ROUGHNESS, SEED))
    reachable = [row for row in report["parcels"] if row["way_exists"]]
    yield Finding(len(reachable) >= PARCELS,
                  "a way leads to %d of %d parcels" % (len(reachable), len(report["parcels"])),
                  "take another seed or more --parcels: at least %d have to be within reach" % PARCELS)
    left = [str(row["parcel"]) for row in reachable if row["delivered"] is None]
    yield Finding(not left, "delivered: %d of these" % (len(reachable) - len(left)),
                  "read why %s was not delivered; does a larger battery or range help?" % ", ".join(left))
    ended = [str(row["robot"]) for row in report["robots"] if row["end"]]
    robots = len(report["robots"])
    yield Finding(not ended, "robots that can move: %d of %d" % (robots - len(ended), robots),
                  "%s did not come back; the report says why" % ", ".join(ended))
