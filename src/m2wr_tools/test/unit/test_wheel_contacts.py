# SPDX-License-Identifier: BSD-3-Clause
"""The tables of ``benchmark --contacts``: closed forms where they are due, and libode where it differs from them."""
import pytest

from m2wr_tools.benchmark import command, wheel_contacts

STEP = 5        # ms


@pytest.fixture(scope="module")
def tables():
    """Return the tables by their titles: rows of cells by the kind of ground."""
    found = {}
    for part in wheel_contacts.report([STEP]).strip().split("\n\n"):
        lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in part.splitlines()]
        found[lines[0][0]] = {line[0]: line[1:] for line in lines[2:]}
    return found


def of(tables, title):
    return next(rows for name, rows in tables.items() if name.startswith(title))


def test_turns_are_exact_with_one_contact_and_slow_with_two(tables):
    rows = of(tables, "contacts of a wheel")
    assert [float(cell) for cell in rows["one, merged"]] == pytest.approx([1.0] * 4, abs=0.002)
    assert all(float(cell) < 0.95 for cell in rows["two"])


def test_steps_are_climbed_by_the_closed_form_except_by_libode(tables):
    least, left = wheel_contacts.due_speeds()
    climb, after = of(tables, "least speed to climb"), of(tables, "left of 1 m/s")
    for kind in ("box", "heightmap"):
        assert float(climb[kind][0]) == pytest.approx(least, abs=0.025)
        assert float(after[kind][0]) == pytest.approx(left, abs=0.03)
    assert least > float(climb["mesh"][0]) > 0.6
    assert float(climb[wheel_contacts.BY_LIBODE][0].split()[-1]) < 0.4
    assert float(after[wheel_contacts.BY_LIBODE][0]) > 0.95


def test_ramps_take_little_energy_and_meshes_the_most(tables):
    lost, drift = of(tables, "energy lost"), of(tables, "drift aside")
    for kind, cells in lost.items():
        assert 0.0 <= float(cells[0].split()[0]) < 1.0
        assert (float(drift[kind][0]) > 1.0) == (kind == "mesh, cells of 10 cm")


def test_a_braked_robot_creeps_by_compliance_alone(tables):
    creep = of(tables, "braked m2wr on 20 degrees")
    assert all(float(cells[0]) < (0.002 if kind.startswith("heightmap") else 0.2) for kind, cells in creep.items())
    assert all(float(cells[0]) < 1.0 for cells in of(tables, "the same, slid before").values())


def test_wheels_slip_more_on_a_steeper_slope(tables):
    for gentle, steep in of(tables, "m2wr drives up").values():
        assert float(steep) < float(gentle) <= 1.0


def test_what_no_speed_of_the_search_climbs_less_than_is_told():
    assert wheel_contacts._speed(0.2) == "< 0.21" and wheel_contacts._speed(0.77) == "0.77"


def test_the_command_prints_them(monkeypatch, capsys):
    monkeypatch.setattr(wheel_contacts, "STEPS", (10,))
    assert command.main(["--contacts"]) == 0
    assert "| 10 ms |" in capsys.readouterr().out
