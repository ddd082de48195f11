# SPDX-License-Identifier: BSD-3-Clause
"""SECURITY.md agrees with the code: every limit in its table is the actual one."""
import os
import re

import workspace_tree as tree
from m2wr_campaign.study import fields
from m2wr_files import state_file, state_types
from m2wr_maps import map_input
from m2wr_sim.model.mesh import files as mesh_files
from m2wr_sim.model.mesh import shapes as mesh_shapes
from m2wr_sim.model.xml import lenient as lenient_xml
from m2wr_sim.model.xml import safe as safe_xml
from m2wr_sim.ros.gazebo_services import spawning

TEXT = tree.read(os.path.join(tree.ROOT, "SECURITY.md"))
LIMITS = [spawning.MOST_TEXT, spawning.MOST_MARKS, spawning._MOST_PARTS, safe_xml.MAX_BYTES, safe_xml.MAX_DEPTH,
          safe_xml.MAX_ATTRIBUTES, lenient_xml._MOST_BYTES, lenient_xml._MOST_AMPERSANDS,
          mesh_files.MAX_MESH_BYTES, mesh_files.MAX_TRIANGLES, mesh_shapes._MAX_PIXELS,
          map_input.MOST_YAML, map_input.MOST_DEPTH, map_input.MOST_PICTURE, map_input.MOST_PIXELS,
          fields.LARGEST_FILE, fields.DEEPEST, state_file.MOST_FILE,
          state_file.MOST_UNPACKED, state_file.MOST_JSON, state_file.MOST_DEPTH, state_types.MOST_ITEMS]
#: Calls that evaluate text, and the files that may use them: on the program's own text, or the user's command line.
EVALUATES = re.compile(r"(?<![\w.])(?:eval|exec)\(|\bpickle\b|yaml\.(?:unsafe_)?load\(|allow_pickle=True|shell=True|"
                       r"os\.system\(|os\.popen\(|marshal\.|shelve\.")
ALLOWED = {"m2wr_node/kernel_cache.py": "exec(", "m2wr_maps/map_input.py": "yaml.load(",
           "m2wr_campaign/study/fields.py": "yaml.load(",
           "m2wr_files/state_file.py": "pickle", "m2wr_gmapping/replay/replay_command.py": "shell=True"}


def test_the_tables_limits_are_those_of_the_code():
    shown = [int(found) for found in re.findall(r"^\| [^|]+ \| (\d+) \| [^|]+ \|$", TEXT, re.MULTILINE)]
    assert shown == LIMITS


def test_only_the_listed_files_evaluate_text():
    found = {}
    for folder in ("src", "dropin"):
        for path in tree.files_below(os.path.join(tree.ROOT, folder)):
            if path.endswith(".py") and "/test/" not in path:
                for match in EVALUATES.finditer(tree.read(path)):
                    found.setdefault("/".join(path.split("/src/")[-1].split("/")), set()).add(match.group())
    assert found == {path: {word} for path, word in ALLOWED.items()}


def test_the_yaml_loader_of_maps_makes_strings_only():
    source = tree.read(map_input.__file__)
    assert source.count("Loader=yaml.BaseLoader") == 2 and source.count("yaml.load(") == 1
