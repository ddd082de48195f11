# SPDX-License-Identifier: BSD-3-Clause
"""Pose graphs as plain arrays: what fits together, files that hold none, and the graph of a mapper."""
import json

import numpy as np
import pytest

from m2wr_gmapping.graph_view import GraphError, GraphView, graph_of, read

NODES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [1.0, 1.0, -3.0]])
EDGES, ACCEPTED = np.array([[0, 2], [0, 1]]), np.array([True, False])


def written(tmp_path, text):
    path = tmp_path / "graph.json"
    path.write_text(text)
    return str(path)


def test_a_file_gives_the_graph_again(tmp_path):
    found = read(written(tmp_path, GraphView(NODES, EDGES, ACCEPTED).text()))
    assert (found.nodes == NODES).all() and (found.edges == EDGES).all() and (found.accepted == ACCEPTED).all()


def test_a_graph_without_edges_is_kept(tmp_path):
    made = GraphView(NODES[:1], np.zeros((0, 2), np.int64), np.zeros(0, bool))
    found = read(written(tmp_path, made.text()))
    assert found.nodes.shape == (1, 3) and found.edges.shape == (0, 2) and found.accepted.shape == (0,)


@pytest.mark.parametrize("nodes, edges, accepted, told", [
    (NODES[:, :2], EDGES, ACCEPTED, "nodes: expected rows"), (NODES * np.nan, EDGES, ACCEPTED, "nodes"),
    (NODES[:2], EDGES, ACCEPTED, "edges: expected pairs of numbers from 0 to 1"), (NODES, -EDGES, ACCEPTED, "edges"),
    (NODES, EDGES, ACCEPTED[:1], "one value for each of 2 edges; got 1")])
def test_arrays_that_do_not_fit_are_refused(nodes, edges, accepted, told):
    with pytest.raises(GraphError, match=told):
        GraphView(nodes, edges, accepted)


@pytest.mark.parametrize("change, told", [
    (dict(nodes=[[1, 2]]), "nodes: expected rows of 3 numbers"), (dict(nodes=None), "nodes"),
    (dict(nodes=[[0, 0, 1e300]] * 3), "nodes"), (dict(edges=[[0, 1.5]] * 2), "whole numbers"),
    (dict(edges=[[0, "x"], [0, 1]]), "edges"), (dict(edges=[[0, 7], [0, 1]]), "from 0 to 2"),
    (dict(accepted=[1, 0]), "true and false"), (dict(accepted=[True]), "one value for each"), (None, "JSON object")])
def test_files_that_hold_no_graph_are_refused(tmp_path, change, told):
    whole = json.loads(GraphView(NODES, EDGES, ACCEPTED).text())
    with pytest.raises(GraphError, match="graph.json: .*" + told):
        read(written(tmp_path, json.dumps(None if change is None else dict(whole, **change))))


@pytest.mark.parametrize("text", ["", "{", "[" * 100000])
def test_text_that_is_no_json_is_refused(tmp_path, text):
    with pytest.raises(GraphError, match="graph.json"):
        read(written(tmp_path, text))
    with pytest.raises(GraphError, match="No such file"):
        read(str(tmp_path / "none.json"))


def test_a_mapper_says_itself_what_its_graph_is():
    class Own:
        def graph_view(self):
            return GraphView(NODES, EDGES, ACCEPTED)

    assert graph_of(Own()).nodes is NODES
