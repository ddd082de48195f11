# SPDX-License-Identifier: BSD-3-Clause
"""Joints of SDF: the axis conventions of its versions, values and types."""
import pytest

from sdf_documents import QUARTER, TURNED, joint, model


@pytest.mark.parametrize("version, flag, expected", [
    ("1.4", "", (0.0, -1.0, 0.0)), ("1.5", "", (1.0, 0.0, 0.0)),
    ("1.6", "<use_parent_model_frame>1</use_parent_model_frame>", (0.0, -1.0, 0.0)),
    ("1.6", "<use_parent_model_frame>0</use_parent_model_frame>", (1.0, 0.0, 0.0)), ("1.7", "", (1.0, 0.0, 0.0))])
def test_axis_frames_of_the_versions(version, flag, expected):
    found = model(TURNED + joint("<axis><xyz>1 0 0</xyz>{}</axis>".format(flag)), version)
    assert found.joints[0].axis.xyz == pytest.approx(expected)


def test_axis_expressed_in_another_frame_and_joint_pose():
    found = model(TURNED + joint('<axis><xyz expressed_in="__model__">2 0 0</xyz></axis>',
                                 more="<pose>0 0 0.5 0 0 {}</pose>".format(QUARTER)), "1.7").joints[0]
    assert found.pose[0] == (0.0, 0.0, 0.5)
    assert found.axis.xyz == pytest.approx((-1.0, 0.0, 0.0))


def test_joint_values():
    found = model(TURNED + joint("""<axis><xyz>0 0 1</xyz>
        <dynamics><damping>0.1</damping><friction>0.2</friction></dynamics>
        <limit><lower>-inf</lower><upper>1</upper><effort>5</effort></limit></axis>
      <physics><ode><limit><erp>0.7</erp><cfm>0.01</cfm></limit></ode></physics>""")).joints[0]
    axis = found.axis
    assert (found.kind, found.parent, found.child) == ("revolute", "a", "b")
    assert (axis.damping, axis.friction, axis.lower, axis.upper, axis.effort, axis.velocity, axis.stop_erp,
            axis.stop_cfm) == (0.1, 0.2, -1e16, 1.0, 5.0, -1.0, 0.7, 0.01)


@pytest.mark.parametrize("kind", ["fixed", "ball", "prismatic", "universal", "screw"])
def test_joint_kinds(kind):
    found = model(TURNED + joint(kind=kind)).joints[0]
    assert found.kind == kind and (found.axis2 is not None) == (kind == "universal")


def test_joint_to_the_world_and_unknown_kind():
    found = model('<link name="a"/><joint name="j" type="fixed"><parent>world</parent><child>a</child></joint>'
                  '<joint name="k" type="spiral"><parent>world</parent><child>a</child></joint>')
    assert [item.parent for item in found.joints] == ["world"]
    assert any("spiral" in note for note in found.notes)
