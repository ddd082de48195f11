# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=sh
# Nodes, master and launch servers listen at the loopback address unless the user says otherwise: ROS gives no one a
# password, so whoever reaches a node commands it. ROS_IP or ROS_HOSTNAME set to this machine's address opens them; where
# ROS_MASTER_URI names another machine nothing is set, for its nodes must reach those here.
if [ -z "${ROS_IP:-}${ROS_HOSTNAME:-}" ]; then
  case "${ROS_MASTER_URI:-}" in
    '' | http://localhost | http://localhost[:/]* | http://127.* | http://\[::1\]*)
      export ROS_IP=127.0.0.1 ;;
  esac
fi
