# SPDX-License-Identifier: BSD-3-Clause
"""Reading an element: defaults, values that are none, and that nothing is ignored in silence."""
import pytest

from m2wr_sim.model.notes import Notes
from m2wr_sim.model.sdf import elements as sdf_elements
from m2wr_sim.model.sdf.loader import load_sdf_models, load_world
from m2wr_sim.model.sdf.node import Node
from m2wr_sim.model.xml.safe import XmlError, parse_xml


def node_of(text, row=None):
    notes = Notes()
    return Node(parse_xml(text, "a.sdf"), notes, row), notes


def test_values_and_defaults():
    node, notes = node_of("<r><f> 2.5 </f><i>50.0</i><t>TRUE</t><v>1 2\n3</v><empty/></r>")
    assert (node.number("f", 0.0), node.whole("i", 0), node.flag("t", False)) == (2.5, 50, True)
    assert node.vector("v", 3, None) == (1.0, 2.0, 3.0) and node.text("empty") == "" and node.text("none") is None
    assert node.number("empty", 7.0) == 7.0 and node.number("missing", 8.0) == 8.0
    node.done()
    assert notes.sentences() == notes.remarks() == ()


def test_a_missing_element_gives_defaults_all_the_way_down():
    node = Node(None, Notes()).child("a").child("b")
    assert not node and node.number("c", 1.5) == 1.5 and node.attribute("d") == "" and node.children("e") == []
    node.done()


@pytest.mark.parametrize("read, text, words", [
    (lambda node: node.number("x", 2.0), "one", 'x is "one"; expected a finite number; using 2.'),
    (lambda node: node.number("x", 2.0, 0.0), "-1", "x is -1; expected zero or a positive number; using 2."),
    (lambda node: node.whole("x", 3, 1), "0", "expected a whole number of at least 1; using 3."),
    (lambda node: node.flag("x", True), "maybe", "expected true or false; using true."),
    (lambda node: node.vector("x", 3, (0.0, 0.0, 1.0)), "1 2", "expected 3 numbers; using 0 0 1."),
    (lambda node: node.positive("x", 0.5), "0", "x is 0; expected a positive number; using 0.5.")])
def test_invalid_value_is_reported_and_replaced_by_default(read, text, words):
    node, notes = node_of("<r><x>{}</x></r>".format(text))
    default, = (read(Node(None, Notes())),)
    assert read(node) == default
    sentence, = notes.sentences()
    assert sentence.startswith("a.sdf:1: <r/x>: ") and sentence.endswith(words)


def test_what_has_no_default_is_an_error():
    node, _ = node_of("<r><x>0</x><size>1 1</size><flat>1 0 1</flat></r>")
    for call, words in ((lambda: node.positive("x"), "x is 0"), (lambda: node.positive("y"), "<y> is missing"),
                        (lambda: node.extent("size", 3), "3 numbers"),
                        (lambda: node.extent("no", 3), "<no> is missing"),
                        (lambda: node.extent("flat", 3), "three positive"), (node.name, "attribute name is missing"),
                        (lambda: node.strict_vector("size", 3, None), "3 numbers")):
        with pytest.raises(XmlError, match=words):
            call()


def test_unread_elements_and_attributes_are_reported_once():
    node, notes = node_of("<link name='l' colour='red'><gravity unit='g'>1<x/></gravity><pose/><pose/><strange/>"
                          "<strange/><enable_wind>true</enable_wind><inner><deep/></inner></link>")
    node.name(), node.flag("gravity", True), node.child("pose"), node.child("inner")
    node.done()
    assert [sentence.partition(": ")[2] for sentence in notes.sentences()] == [
        "unsupported attribute unit of <gravity> ignored.", "unsupported element <x> in <gravity> ignored.",
        "there is another <pose> in <link>; the first is read.", "unsupported element <strange> in <link> ignored.",
        "unsupported attribute colour of <link> ignored.", "unsupported element <deep> in <inner> ignored."]
    assert notes.remarks() == ("a.sdf: without effect on the simulation: <enable_wind> in <link> (line 1).",)
    node.done()
    assert len(notes.sentences()) == 6


def test_element_without_effect_is_not_reported():
    node, notes = node_of("<link><enable_wind>false</enable_wind><must_be_base_link>0</must_be_base_link></link>")
    node.done()
    assert notes.sentences() == notes.remarks() == ()


def test_reasons_are_given():
    node, notes = node_of("<link><battery/></link>")
    node.done()
    assert "unsupported element <battery> in <link> ignored; no charge is simulated." in notes.sentences()[0]


# -- the tables ---------------------------------------------------------------------------------------------------

BOX = "<geometry><box><size>1 1 1</size></box></geometry>"
GEOMETRIES = ("<empty/>", "<box><size>1 1 1</size></box>", "<cylinder><radius>1</radius><length>1</length></cylinder>",
              "<sphere><radius>1</radius></sphere>", "<plane><normal>0 0 1</normal></plane>",
              "<mesh><uri>gone.stl</uri><submesh><name>a</name></submesh></mesh>",
              "<mesh><filename>gone.stl</filename></mesh>",
              "<heightmap><uri>gone.png</uri></heightmap>",
              "<polyline><point>0 0</point><point>1 0</point><point>1 1</point><height>1</height></polyline>")
SURFACE = """<surface><friction><ode/><torsional/></friction><contact><ode/></contact><bounce/></surface>"""
SENSORS = """<sensor name="r" type="ray"><pose/><plugin name="p" filename="libp.so"/><ray><scan><horizontal/><vertical/>
</scan><range/><noise/></ray></sensor><sensor name="i" type="imu"><imu><angular_velocity><x><noise/></x><y/><z/>
</angular_velocity><linear_acceleration><x/><y/><z/></linear_acceleration></imu></sensor><sensor name="e" type="imu">
<imu><noise><rate/><accel/></noise></imu></sensor><sensor name="c" type="contact"><contact><collision>c</collision>
</contact></sensor><sensor name="k" type="camera"><camera><image/><clip/><noise/><distortion><k1>0</k1></distortion>
</camera></sensor>"""
EVERYTHING = """<sdf version="1.7"><world name="w"><physics type="ode"><ode><solver/><constraints/></ode></physics>
<scene/><light name="sun"><attenuation/></light><frame name="f"/><plugin name="p" filename="libw.so"/><include>
<uri>model://gone</uri></include><model name="m"><static>1</static><frame name="g"><pose/></frame><link name="a">
<velocity_decay/><inertial><inertia/></inertial>""" + "".join(
    '<collision name="c%d"><geometry>%s</geometry>%s</collision>' % (index, geometry, "" if index else SURFACE)
    for index, geometry in enumerate(GEOMETRIES)) + """<visual name="v">""" + BOX + """<material><script/></material>
</visual>""" + SENSORS + """</link><link name="b"/><joint name="j" type="universal"><parent><link>a</link></parent>
<child><link>b</link></child><axis><xyz>0 0 1</xyz><mimic joint="k"><offset>0</offset></mimic><dynamics/><limit/></axis>
<axis2><xyz>0 1 0</xyz></axis2><physics>
<ode><limit/></ode></physics></joint><joint name="k" type="screw"><parent>a</parent><child>b</child></joint><joint
name="l" type="gearbox"><parent>a</parent><child>b</child></joint><model name="n"><link name="c"/></model></model>
<state world_name="w"><deletions>
<name>x</name></deletions><insertions/><model name="m"><pose/><link name="a"><pose/></link><model name="n"/>
</model></state>
<actor name="person"><pose>0 0 0 0 0 0</pose><skin><filename>walk.dae</filename><scale>1</scale></skin><script>
<trajectory id="0"><waypoint><time>0</time><pose>0 0 0 0 0 0</pose></waypoint><waypoint><time>1</time>
<pose>1 0 0 0 0 0</pose></waypoint></trajectory></script></actor></world></sdf>"""


def test_the_table_of_what_is_read_is_what_the_readers_ask_for(monkeypatch):
    asked = set()
    ask, children = Node._ask, Node.children
    monkeypatch.setattr(Node, "_ask", lambda self, tag: asked.add((self.row, tag)) or ask(self, tag))
    monkeypatch.setattr(Node, "children", lambda self, tag: asked.add((self.row, tag)) or children(self, tag))
    told = load_world(EVERYTHING, "a.world").notes
    assert all(any(part in note for part in ("gone", "gearbox names", "has no link", "skin and animation"))
               for note in told), told
    known = {(row, tag) for row, tags in sdf_elements.READ.items() for tag in tags}
    assert sorted(known - asked) == []
    asked -= {("actor", tag) for tag in sdf_elements.READ["model"]} - known       # an actor is read as a model
    assert sorted((row, tag) for row, tag in asked - known if row in sdf_elements.READ and "gone" not in tag) == []
    assert sorted({row for row, _ in asked if row is not None} - set(sdf_elements.READ) - {"pose", "xyz"}) == []


def test_no_element_is_in_two_columns():
    for row, tags in sdf_elements.READ.items():
        told = {tag for parent, tag in sdf_elements.REASONS if parent == row}
        assert not tags & sdf_elements.QUIET.get(row, set()) and not tags & told
        assert not told & sdf_elements.QUIET.get(row, set())
    rows = set(sdf_elements.QUIET) | {row for row, _ in sdf_elements.REASONS} | set(sdf_elements.DIFFERS)
    assert rows <= set(sdf_elements.READ)
    assert set(sdf_elements.IDLE) <= {(row, tag) for row, tags in sdf_elements.QUIET.items() for tag in tags} | set(
        sdf_elements.REASONS)


ORDINARY = {
    "saved by Gazebo": """<world name='default'><light name='sun' type='directional'><cast_shadows>1</cast_shadows>
      <pose frame=''>0 0 10 0 -0 0</pose><diffuse>0.8 0.8 0.8 1</diffuse><specular>0.2 0.2 0.2 1</specular><attenuation>
      <range>1000</range><constant>0.9</constant><linear>0.01</linear><quadratic>0.001</quadratic></attenuation>
      <direction>-0.5 0.1 -0.9</direction></light><physics name='default_physics' default='0' type='ode'>
      <max_step_size>0.001</max_step_size><real_time_factor>1</real_time_factor>
      <real_time_update_rate>1000</real_time_update_rate><gravity>0 0 -9.8</gravity></physics>
      <gravity>0 0 -9.8</gravity><magnetic_field>6e-06 2.3e-05 -4.2e-05</magnetic_field><atmosphere type='adiabatic'/>
      <scene><ambient>0.4 0.4 0.4 1</ambient><background>0.7 0.7 0.7 1</background><shadows>1</shadows></scene>
      <audio><device>default</device></audio><wind/><spherical_coordinates><surface_model>EARTH_WGS84</surface_model>
      </spherical_coordinates><state world_name='default'><sim_time>12 5000000</sim_time><real_time>1 2</real_time>
      <wall_time>3 4</wall_time><iterations>5</iterations><model name='box'><pose frame=''>1 0 0 0 0 0</pose>
      <scale>1 1 1</scale><link name='link'><pose frame=''>1 0 0 0 0 0</pose><velocity>0 0 0 0 -0 0</velocity>
      <acceleration>0 0 0 0 -0 0</acceleration><wrench>0 0 0 0 -0 0</wrench></link><model name='lid'><pose>0 0 1 0 0 0
      </pose><scale>1 1 1</scale><link name='link'><pose>0 0 1 0 0 0</pose></link></model></model><light name='sun'>
      <pose frame=''>0 0 10 0 -0 0</pose></light></state><gui fullscreen='0'><camera name='user_camera'>
      <pose frame=''>5 -5 2 0 0.3 2.4</pose><view_controller>orbit</view_controller></camera></gui>
      <model name='box'><pose frame=''>0 0 0.5 0 -0 0</pose><link name='link'><inertial><mass>1</mass><inertia>
      <ixx>0.2</ixx><ixy>0</ixy><ixz>0</ixz><iyy>0.2</iyy><iyz>0</iyz><izz>0.2</izz></inertia></inertial>
      <collision name='collision'><geometry><box><size>1 1 1</size></box></geometry><max_contacts>10</max_contacts>
      <surface><contact><ode/></contact><bounce/><friction><torsional><ode/></torsional><ode/></friction></surface>
      </collision><visual name='visual'><geometry><box><size>1 1 1</size></box></geometry><material><script>
      <name>Gazebo/Grey</name><uri>file://media/materials/scripts/gazebo.material</uri></script></material>
      <cast_shadows>1</cast_shadows><transparency>0</transparency></visual><self_collide>0</self_collide>
      <enable_wind>0</enable_wind><kinematic>0</kinematic></link></model></world>""",
    "a mobile robot's room": """<world name="default"><scene><ambient>0.4 0.4 0.4 1</ambient></scene><gui
      fullscreen="0"><camera name="user_camera"><pose>0 0 20 0 1.5 0</pose></camera></gui><physics type="ode">
      <real_time_update_rate>1000.0</real_time_update_rate><max_step_size>0.001</max_step_size>
      <real_time_factor>1</real_time_factor><ode><solver><type>quick</type><iters>150</iters>
      <precon_iters>0</precon_iters><sor>1.400000</sor><use_dynamic_moi_rescaling>1</use_dynamic_moi_rescaling></solver>
      <constraints><cfm>0.00001</cfm><erp>0.2</erp>
      <contact_max_correcting_vel>2000.000000</contact_max_correcting_vel>
      <contact_surface_layer>0.01000</contact_surface_layer></constraints></ode></physics><model name="wall">
      <static>1</static><link name="l"><collision name="c"><geometry><box><size>1 1 1</size></box></geometry><surface>
      <friction><ode><mu>0.9</mu><mu2>0.9</mu2></ode><bullet><friction>1</friction></bullet></friction><contact>
      <poissons_ratio>0.3</poissons_ratio><elastic_modulus>0</elastic_modulus><ode><soft_cfm>0</soft_cfm>
      <soft_erp>0.2</soft_erp><kp>1e13</kp></ode></contact></surface></collision></link></model></world>"""}


@pytest.mark.parametrize("name", sorted(ORDINARY))
def test_ordinary_worlds_cause_one_quiet_line_and_no_warning(name):
    world = load_world('<sdf version="1.6">' + ORDINARY[name] + "</sdf>", "a.world")
    assert world.models and world.notes == ()
    assert len(world.remarks) == 1 and "<gui> in <world>" in world.remarks[0] and "\n" not in world.remarks[0]


@pytest.mark.parametrize("text, words", [
    ("<friction><torsional><patch_radius>0.1</patch_radius></torsional></friction>", "<torsional> in <friction>"),
    ("<friction><torsional><use_patch_radius>0</use_patch_radius><surface_radius>1</surface_radius></torsional>"
     "</friction>",
     "<torsional> in <friction>"),
    ("<contact><elastic_modulus>1e6</elastic_modulus></contact>", "<elastic_modulus> in <contact>"),
    ("<contact><category_bitmask>1</category_bitmask></contact>", "<category_bitmask> in <contact>")])
def test_unsupported_friction_and_stiffness_are_reported(text, words):
    model, = load_sdf_models('<sdf version="1.6"><model name="m"><link name="l"><collision name="c">%s<surface>'
                             "%s</surface></collision></link></model></sdf>" % (BOX, text))
    assert words in model.notes[0] and "ignored" in model.notes[0]


def test_unsupported_solver_values_of_joints_are_reported():
    joint = ('<sdf version="1.6"><model name="m"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
             '<parent>a</parent><child>b</child><physics><ode><fudge_factor>0.5</fudge_factor><cfm>{0}</cfm>'
             "<max_force>{0}</max_force><erp>0.2</erp></ode></physics></joint></model></sdf>")
    quiet, loud = (load_sdf_models(joint.format(value))[0] for value in ("0", "0.1"))
    assert quiet.notes == quiet.remarks == () and quiet.joints[0].axis.fudge_factor == 0.5
    assert ["<cfm>" in note or "<max_force>" in note for note in loud.notes] == [True, True]


def test_versions_after_1_7_what_is_read_of_them():
    body = """<link name="a"><pose>0 0 1 0 0 0</pose></link><frame name="top"><pose degrees="true">0 0 2 0 0 90
      </pose></frame>
      <link name="b"><pose rotation_format="quat_xyzw">1 0 0 0 0 0 2</pose></link>"""
    text = ('<sdf version="1.7"><model name="m" placement_frame="top" canonical_link="b"><pose>5 0 0 0 0 0</pose>%s'
            "</model></sdf>")
    model, = load_sdf_models(text % body)
    assert model.pose[0] == pytest.approx((5.0, 0.0, -2.0)) and model.links[1].pose == ((1, 0, 0), (0, 0, 0, 1))
    assert model.pose[1] == pytest.approx((0.0, 0.0, -0.5 ** 0.5, 0.5 ** 0.5))
    note, = model.notes
    assert "canonical_link" in note and '"a", stands for the model' in note


def test_placement_frame_is_applied_and_merge_is_reported(tmp_path):
    path = tmp_path / "post.sdf"
    path.write_text('<sdf version="1.6"><model name="post"><link name="top"><pose>0 0 2 0 0 0</pose></link></model>'
                    "</sdf>")
    text = ('<sdf version="1.7"><world name="w"><include{}><uri>post</uri><pose>1 0 0 0 0 0</pose><placement_frame>{}'
            "</placement_frame></include></world></sdf>")
    world = load_world(text.format("", "top"), "a.world", lambda uri: str(path))
    assert world.models[0].pose[0] == (1.0, 0.0, -2.0) and world.notes == ()
    world = load_world(text.format(' merge="true"', "nowhere"), "a.world", lambda uri: str(path))
    assert world.models[0].pose[0] == (1.0, 0.0, 0.0)
    assert ["merge" in note or "placement_frame" in note for note in world.notes] == [True, True]
