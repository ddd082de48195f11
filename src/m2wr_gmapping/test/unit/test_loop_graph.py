# SPDX-License-Identifier: BSD-3-Clause
"""Loop closures: their information, and the graph that they make with the steps."""
import numpy as np
import pytest

from m2wr_gmapping.backend import loop_graph
from m2wr_gmapping.backend.route import Route, distances_along
from m2wr_gmapping.backend.step_history import StepHistory
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend import track as tr
from m2wr_gmapping.frontend.matcher import FastMatcher
from m2wr_gmapping.tuning import LINKS
from m2wr_node.thread_team import ThreadTeam


@pytest.mark.parametrize("seed", range(3))
def test_link_information_equals_numpy(seed):
    root = np.random.default_rng(seed).normal(size=(3, 3))
    h, row, path = root @ root.T * 50.0, np.zeros(mk.RESULT_SIZE), np.zeros((5, 3))
    row[:3], row[mk.INFORMATION:] = (1.0, 2.0, 0.5), h[np.triu_indices(3)]
    prior, floor = np.array(LINKS.prior), np.square(LINKS.floor)
    wanted = np.linalg.inv(h / loop_graph.DEPENDENT + np.diag(prior**-2)) + np.diag(floor)
    old, new, measured, information = loop_graph.link_of(path, 2, row)
    assert (old, new) == (2, 4) and (measured == row[:3]).all()
    assert np.allclose(information, np.linalg.inv(wanted))


def test_loop_closure_uses_the_smoothed_calibration():
    """Wheels that tell 3 % too much along a plain corridor; only near its end scans tell of it."""
    history, path, row = StepHistory(), np.zeros((101, 3)), np.zeros(mk.RESULT_SIZE)
    row[mk.INFORMATION:] = np.diag([0.0, 2e4, 2e4])[np.triu_indices(3)]
    for k in range(1, 101):
        step = tr.record_of(history.next_record())
        step.forward[0] = step.derivative[0, tr.DISTANCE] = 0.5
        if k > 60:
            step.information[tr.DISTANCE, tr.DISTANCE], step.vector[tr.DISTANCE] = 5e4, -0.03 * 5e4
        history.set_information(row, np.full(3, 0.01**2))
        path[k, 0] = path[k - 1, 0] + 0.5 * 1.03
    graph = loop_graph.LoopGraph(FastMatcher(GmappingConfig.from_mapping({}), ThreadTeam(1)), 0.05, history)
    graph.links.append((0, 20, np.array([20 * 0.5, 0.0, 0.0]), np.diag([1e-4, 2e3, 1e4])))
    bent = graph.solve(path)
    assert bent[60, 0] == pytest.approx(30.0, abs=0.1)      # 30.9 without
    assert bent[100, 0] == pytest.approx(50.0, abs=0.1)


def test_contradicted_loop_closure_is_removed():
    history, row, path = StepHistory(), np.zeros(mk.RESULT_SIZE), np.zeros((41, 3))
    row[mk.INFORMATION:] = np.eye(3)[np.triu_indices(3)] * 1e5
    path[:, 0] = np.arange(41) * 0.5
    for _ in range(40):
        tr.record_of(history.next_record())
        history.set_information(row, np.full(3, 0.01**2))
    graph = loop_graph.LoopGraph(FastMatcher(GmappingConfig.from_mapping({}), ThreadTeam(1)), 0.05, history)
    right = [(k, 40 - k, np.array([20.0 - k, 0.2, 0.0]), np.diag([1e3, 1e3, 1e4])) for k in range(3)]
    graph.links = right + [(4, 38, np.array([12.0, 5.0, 0.5]), np.diag([1e3, 1e3, 1e4]))]
    solved = graph.solve(path, True)
    assert solved[40, 1] == pytest.approx(0.2, abs=0.1)
    assert graph.links == right and graph.rejected == [(4, 38)]
    graph.reject([(4, 38, None, None)])
    assert graph.rejected == [(4, 38)]


@pytest.fixture
def wandering():
    """A graph, and the route of a robot that comes back to places it has seen."""
    history, row, rng = StepHistory(), np.zeros(mk.RESULT_SIZE), np.random.default_rng(4)
    row[mk.INFORMATION:] = np.eye(3)[np.triu_indices(3)] * 1e5
    path = np.cumsum(rng.normal(0.0, 1.5, (150, 3)), axis=0) * (1.0, 1.0, 0.1)
    for _ in range(149):
        history.next_record()
        history.set_information(row, np.full(3, 0.01**2))
    graph = loop_graph.LoopGraph(FastMatcher(GmappingConfig.from_mapping({}), ThreadTeam(1)), 0.05, history)
    return graph, Route(path, distances_along(path), [None] * 150)


@pytest.mark.parametrize("correction", (None, [1.0, -2.0, 0.1]))
def test_nodes_with_near_ones_may_be_near(wandering, correction):
    graph, route = wandering
    expected = [graph.may_be_near(route, node, correction) for node in range(1, 150)]
    found = [len(graph.scene(route, node, correction)[1]) > 0 for node in range(1, 150)]
    assert all(may for may, near in zip(expected, found) if near)
    assert any(found) and not all(expected)


def test_link_nodes_follow_the_links(wandering):
    graph, _ = wandering
    assert graph.link_nodes.shape == (0, 2)
    links = [(k, k + 20, np.zeros(3), np.eye(3)) for k in range(6)]
    graph.links.extend(links[:4])
    assert graph.link_nodes.tolist() == [[k, k + 20] for k in range(4)]
    graph.links.extend(links[4:])
    assert graph.link_nodes.tolist() == [[k, k + 20] for k in range(6)]
    graph.replace_links(links[2:4])
    assert graph.link_nodes.tolist() == [[2, 22], [3, 23]]
