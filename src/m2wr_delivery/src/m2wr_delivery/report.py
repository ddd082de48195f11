# SPDX-License-Identifier: BSD-3-Clause
"""The report of a run: what was delivered, when, what was not, and why; as text and as JSON."""
from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Dict, List

from m2wr_delivery.dispatcher import ASSIGNED

if TYPE_CHECKING:
    from m2wr_delivery.referee import Cargo, Referee
    from m2wr_delivery.scenario import Scenario


def _why_not(cargo: Cargo, referee: Referee) -> str:
    """Return why a parcel was not delivered, and where it is."""
    entry = referee.base.entries[cargo.parcel.name]
    reasons = ["{}: {}".format(robot, reason) for robot, reason in sorted(entry.attempts.items())]
    if not reasons and entry.state == ASSIGNED:
        reasons = ["{} was on its way".format(entry.robot)]
    why = "; ".join(reasons) or "no robot took it"
    if cargo.carried:
        return "{}; it is on {}".format(why, cargo.robot)
    if cargo.picked_up is None:
        return why
    return "{}; it lies at ({:.1f}, {:.1f})".format(why, *cargo.place)


def result_of(scenario: Scenario, referee: Referee, ended: str) -> Dict[str, Any]:
    """Return the run as JSON would hold it.

    Parameters
    ----------
    scenario : Scenario
    referee : Referee
        At the end.
    ended : str
        Why the run ended.
    """
    began = referee.began
    parcels = []
    for name, cargo in referee.cargo.items():
        row: Dict[str, Any] = {"parcel": name, "from": scenario.name_of(cargo.parcel.pick_up),
                               "to": scenario.name_of(cargo.parcel.drop_off), "robot": cargo.robot,
                               "picked_up": None if cargo.picked_up is None else round(cargo.picked_up - began, 2),
                               "delivered": None if cargo.delivered is None else round(cargo.delivered - began, 2),
                               "way_exists": scenario.solvable[name]}
        if cargo.delivered is None:
            row["why_not"] = _why_not(cargo, referee)
        parcels.append(row)
    time = referee.time - began
    robots = [{"robot": name, "distance": round(member.distance, 2), "energy": round(member.battery.used, 1),
               "charged": round(member.battery.charged, 1), "battery": round(member.battery.share, 3),
               "in_contact": round(member.in_contact / max(time, 1e-9), 3), "end": member.lost}
              for name, member in referee.members.items()]
    return {"seed": scenario.seed, "settings": dict(vars(scenario.settings)), "time": round(time, 2), "ended": ended,
            "parcels": parcels, "robots": robots, "events": [[round(at, 2), text] for at, text in referee.events]}


def succeeded(result: Dict[str, Any]) -> bool:
    """Return whether every parcel was delivered to which a way leads."""
    return all(row["delivered"] is not None for row in result["parcels"] if row["way_exists"])


def text_of(result: Dict[str, Any]) -> str:
    """Return the report for people.

    Parameters
    ----------
    result : dict
        Of :func:`result_of`.
    """
    lines: List[str] = ["parcel    from to  result"]
    for row in result["parcels"]:
        if row["delivered"] is not None:
            found = "picked up at {:.0f} s, delivered at {:.0f} s by {}".format(
                row["picked_up"], row["delivered"], row["robot"])
        else:
            found = "not delivered{}: {}".format("" if row["way_exists"] else " (no way exists)", row["why_not"])
        lines.append("{:9} {:4} {:3} {}".format(row["parcel"], row["from"], row["to"], found))
    lines += ["", "robot     driven [m]  used [J]  charged [J]  battery  in contact  end"]
    for row in result["robots"]:
        lines.append("{:9} {:10.1f} {:9.0f} {:12.0f} {:7.0f} % {:9.0f} %  {}".format(
            row["robot"], row["distance"], row["energy"], row["charged"], 100.0 * row["battery"],
            100.0 * row["in_contact"], row["end"] or "can move"))
    done = sum(row["delivered"] is not None for row in result["parcels"])
    lines += ["", "result: {} of {} parcels delivered in {:.0f} s; the run ended by: {}".format(
        done, len(result["parcels"]), result["time"], result["ended"])]
    return "\n".join(lines) + "\n"


def write(path: str, result: Dict[str, Any]) -> None:
    """Write the run as JSON.

    Parameters
    ----------
    path : str
    result : dict
        Of :func:`result_of`.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    with open(path, "w", encoding="utf-8") as file:
        json.dump(result, file, indent=1)
        file.write("\n")
