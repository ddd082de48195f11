# SPDX-License-Identifier: BSD-3-Clause
"""The command ``convert_recording``: a bag as an MCAP file, or back."""
from __future__ import annotations

import argparse
import os
import sys
from typing import List, Optional

from m2wr_node.user_folder import from_user
from m2wr_view.errors import ViewError

ENDINGS = {".bag": ".mcap", ".mcap": ".bag"}


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point; returns the exit code: 0, 1 if the recording cannot be converted, 2 on misuse."""
    parser = argparse.ArgumentParser(
        prog="convert_recording",
        description="Write an MCAP file from a bag, or a bag from an MCAP file of ROS 1, with the same messages.")
    parser.add_argument("source", metavar="FILE", help="a .bag or .mcap file")
    parser.add_argument("target", metavar="NEW_FILE", nargs="?", help="by default FILE with the other ending")
    given = parser.parse_args(sys.argv[1:] if argv is None else argv)
    source = from_user(given.source)
    base, ending = os.path.splitext(source)
    if ending not in ENDINGS:
        parser.error("%s: expected a file that ends with .bag or .mcap" % given.source)
    target = from_user(given.target) if given.target else base + ENDINGS[ending]
    if os.path.splitext(target)[1] != ENDINGS[ending]:
        parser.error("%s: expected a name that ends with %s" % (target, ENDINGS[ending]))
    from m2wr_tools.runs.mcap_files import bag_to_mcap, mcap_to_bag
    try:
        copied = (bag_to_mcap if ending == ".bag" else mcap_to_bag)(source, target)
    except ViewError as error:
        sys.stderr.write("convert_recording: %s\n" % error)
        return 1
    print("%s: %d messages on %d topics" % (target, copied.messages, copied.topics))
    return 0
