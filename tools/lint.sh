#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Static checks of the whole workspace: a warning is an error. Every check runs, then the exit code tells.
#   tools/lint.sh [CHECK ...]   only these checks: catkin flake8 ruff docstrings mypy licence xml shell structure
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
# shellcheck source=tools/venv.sh
source "$WORKSPACE/tools/venv.sh"

make_venv "$LINT_VENV" "$WORKSPACE/tools/requirements-lint.txt"
enter_run_environment
cd "$WORKSPACE"
failed=()

# Files of the workspace, without those written by builds; arguments are find's tests.
sources() {
    find . \( -name .git -o -name '.venv*' -o -name build -o -name catkin_build -o -name devel -o -name 'install*' \
        -o -name logs -o -name test_results -o -name demo_output -o -name api_docs -o -name __pycache__ -o -name .pytest_cache \) -prune \
        -o -type f "$@" -print0
}

# test/data is excluded: its fixtures are broken on purpose.
lint_xml() {
    mapfile -d '' -t files < <(sources \( -name '*.launch' -o -name '*.test' -o -name '*.xacro' -o -name '*.gazebo' \
        -o -name '*.urdf' -o -name '*.world' -o -name '*.sdf' -o -name package.xml -o -name model.config \) \
        ! -path '*/test/data/*')
    "$PYTHON" tools/check_xml.py "${files[@]}"
}

lint_shell() {
    mapfile -d '' -t files < <(sources \( -name '*.sh' -o -path './.ci/run' \))
    local file result=0
    for file in "${files[@]}"; do
        bash -n "$file" || result=1
    done
    if command -v shellcheck >/dev/null; then
        shellcheck --external-sources "${files[@]}" || result=1
    fi
    return $result
}

# Python programs without the ending .py.
python_scripts() {
    mapfile -d '' -t files < <(sources -perm -u+x ! -name '*.py' ! -name '*.sh')
    awk 'FNR == 1 && /^#!.*python/ { print FILENAME } { nextfile }' "${files[@]}" | sort
}

lint_flake8() {
    mapfile -t scripts < <(python_scripts)
    "$PYTHON" -m flake8 . "${scripts[@]}"
}

# The CMakeLists.txt of a metapackage must have the lines of REP 127 and no others.
lint_licence() {
    mapfile -d '' -t files < <(sources \( -name '*.py' -o -name '*.sh' -o -name CMakeLists.txt -o -perm -u+x \) \
        ! -path '*/test/data/*' ! -path './dropin/gazebo_ros_pkgs/CMakeLists.txt')
    "$PYTHON" tools/check_spdx.py "$@" "${files[@]}"
}

# Import order, frequent mistakes, docstrings: rules and exceptions in ruff.toml.
lint_ruff() {
    "$LINT_VENV/bin/ruff" check --quiet .
}

# Sections of docstrings.
lint_docstrings() {
    "$PYTHON" tools/check_docstrings.py dropin/*/src dropin/xacro/launcher src/m2wr_bridge/src \
        src/m2wr_campaign/src src/m2wr_course/src src/m2wr_delivery/src src/m2wr_elevation/src src/m2wr_exploration/src src/m2wr_files/src src/m2wr_gmapping/src src/m2wr_live/src src/m2wr_lockstep/src src/m2wr_maps/src src/m2wr_navigation/src src/m2wr_node/src \
        src/m2wr_nodelet/src \
        src/m2wr_sim/src src/m2wr_tools/src src/motion_plan/src src/m2wr_view/src
}

# Types: setup.cfg says what is checked. Without the paths of a build, so that each checkout gives the same result.
lint_mypy() {
    env -u PYTHONPATH "$LINT_VENV/bin/mypy" --no-error-summary
}

lint_catkin() {
    mapfile -t packages < <(find src dropin test -path test/data -prune -o -name package.xml -printf '%h\n' | sort)
    catkin_lint --config tools/catkin_lint.ini "${packages[@]}"
}

lint_structure() {
    "$PYTHON" -m pytest -q -p no:cacheprovider test/unit/test_layers.py test/unit/test_python_floor.py \
        test/unit/test_registered.py test/unit/test_names_of_tests.py
}

[ $# -gt 0 ] || set -- catkin flake8 ruff docstrings mypy licence xml shell structure
for name in "$@"; do
    [ "$(type -t "lint_$name")" = function ] || die "lint: unknown check $name"
    say "lint: $name"
    "lint_$name" || failed+=("$name")
done
[ ${#failed[@]} -eq 0 ] || die "lint: failed: ${failed[*]}"
say "lint: clean"
