# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=sh
# Nodes, master and launch servers listen on the loopback address by default: ROS has no authentication, so any host that
# reaches a node can command it. Set ROS_IP or ROS_HOSTNAME to this machine's address to open them. If ROS_MASTER_URI
# names another machine, nothing is set, because its nodes must reach those here.
if [ -z "${ROS_IP:-}${ROS_HOSTNAME:-}" ]; then
  case "${ROS_MASTER_URI:-}" in
    '' | http://localhost | http://localhost[:/]* | http://127.* | http://\[::1\]*)
      export ROS_IP=127.0.0.1 ;;
  esac
fi
