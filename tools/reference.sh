#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Writes docs/reference.md and docs/reference/mapping_constants.md from the code and from the topics and services of
# running nodes.
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

enter_run_environment
exec "$PYTHON" "$WORKSPACE/tools/reference.py" --graph
