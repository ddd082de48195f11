#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Removes everything that set-up, build, demo and test have written into the workspace. System packages stay.
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

cd "$WORKSPACE"
rm -rf build catkin_build devel install install_build install_devel logs test_results demo_output api_docs .venv .venv_lint
rm -rf .mypy_cache .pytest_cache .ruff_cache
rm -rf .catkin_tools/profiles/*/packages .catkin_tools/profiles/*/*.cached .catkin_tools/profiles.yaml
find . -name .git -prune -o -type d -name __pycache__ -print0 | xargs -0 -r rm -rf
say "clean"
