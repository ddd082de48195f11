// SPDX-License-Identifier: BSD-3-Clause
// Beside viser's page: the status of the simulation as text, arrow keys and a joystick. What comes from the simulation is
// only ever set as text.
"use strict";
(() => {
  const SEND_PERIOD = 100;        // ms between two messages while a key or the joystick is pressed
  const KEYS = {ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1]};
  const add = (parent, kind, id) => {
    const element = document.createElement(kind);
    element.id = id;
    parent.appendChild(element);
    return element;
  };
  const corner = add(document.body, "div", "m2wr-corner");
  const error = add(document.body, "div", "m2wr-error");
  const drive = add(corner, "div", "m2wr-drive");
  const status = add(corner, "div", "m2wr-status");
  const pad = add(drive, "div", "m2wr-pad");
  const knob = add(pad, "div", "m2wr-knob");
  const robot = add(drive, "select", "m2wr-robot");
  const hint = add(drive, "div", "m2wr-hint");
  pad.title = "drag to drive; or use the arrow keys";
  robot.title = "topic of the commands";
  const HINT = "arrow keys or drag";
  const pressed = new Set();
  let joystick = [0, 0], socket = null, sent = [0, 0], timer = null, hide = null, retry = 200;

  const say = (text) => {
    error.textContent = text;
    error.style.display = "block";
    clearTimeout(hide);
    hide = setTimeout(() => { error.style.display = "none"; }, 6000);
  };

  const show = (message) => {
    if (message.error) { say(message.error); return; }
    const lines = message.lines || [];
    status.textContent = lines.join("\n");
    status.style.display = lines.length ? "block" : "none";
    const topics = message.drive || [];
    drive.style.display = topics.length ? "block" : "none";
    const known = Array.from(robot.options).map((option) => option.value);
    if (known.join("\n") !== topics.join("\n")) {
      const chosen = robot.value;
      robot.replaceChildren(...topics.map((topic) => {
        const option = document.createElement("option");
        option.value = option.textContent = topic;
        return option;
      }));
      if (topics.includes(chosen)) { robot.value = chosen; }
      robot.style.display = topics.length > 1 ? "block" : "none";
    }
    const others = (message.others || {})[robot.value];
    hint.textContent = others ? HINT + "; " + others + " drives too" : HINT;
  };

  const wanted = () => {
    const sum = [joystick[0], joystick[1]];
    for (const key of pressed) { sum[0] += KEYS[key][0]; sum[1] += KEYS[key][1]; }
    return sum.map((value) => Math.max(-1, Math.min(1, value)));
  };

  // Sends at once when the wish changes, then again and again while something is pressed.
  const send = () => {
    clearTimeout(timer);
    const now = wanted();
    const active = now[0] !== 0 || now[1] !== 0;
    const changed = now[0] !== sent[0] || now[1] !== sent[1];
    if ((active || changed) && socket && socket.readyState === WebSocket.OPEN && robot.value) {
      if (socket.bufferedAmount === 0 || !active) {
        socket.send(JSON.stringify({topic: robot.value, forward: now[0], left: now[1]}));
      }
      sent = now;
    }
    if (active) { timer = setTimeout(send, SEND_PERIOD); }
  };

  const release = () => { pressed.clear(); joystick = [0, 0]; knob.style.transform = ""; send(); };
  const typing = (target) => target instanceof Element &&
    (target.matches("input, textarea, select, [contenteditable]") || target.closest("[role=slider], [role=tablist]"));

  window.addEventListener("keydown", (event) => {
    if (!(event.key in KEYS) || drive.style.display !== "block" || typing(event.target) || event.ctrlKey ||
        event.altKey || event.metaKey) { return; }
    event.preventDefault();
    event.stopImmediatePropagation();       // else viser would turn the camera
    if (!pressed.has(event.key)) { pressed.add(event.key); send(); }
  }, true);
  window.addEventListener("keyup", (event) => {
    if (pressed.delete(event.key)) { event.stopImmediatePropagation(); send(); }
  }, true);
  window.addEventListener("blur", release);
  document.addEventListener("visibilitychange", () => { if (document.hidden) { release(); } });

  // A list keeps the focus after a choice, and would take the arrow keys.
  const leave = () => { if (typing(document.activeElement)) { document.activeElement.blur(); } };
  document.addEventListener("click", (event) => {
    if (event.target instanceof Element && event.target.closest("[role=option]")) { setTimeout(leave, 0); }
  }, true);
  document.addEventListener("pointerdown", (event) => {
    if (event.target instanceof HTMLCanvasElement) { leave(); }
  }, true);

  const steer = (event) => {
    const box = pad.getBoundingClientRect(), reach = box.width / 2 - 12;
    let x = (event.clientX - box.left - box.width / 2) / reach, y = (event.clientY - box.top - box.height / 2) / reach;
    const length = Math.hypot(x, y);
    if (length > 1) { x /= length; y /= length; }
    knob.style.transform = "translate(" + x * reach + "px, " + y * reach + "px)";
    joystick = [-y, -x];
    send();
  };
  pad.addEventListener("pointerdown", (event) => { pad.setPointerCapture(event.pointerId); steer(event); });
  pad.addEventListener("pointermove", (event) => { if (pad.hasPointerCapture(event.pointerId)) { steer(event); } });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) { pad.addEventListener(name, release); }

  const connect = () => {
    socket = new WebSocket(new URL("m2wr", location.href.split("?")[0]).href.replace(/^http/, "ws"));
    socket.onopen = () => { retry = 200; };
    socket.onmessage = (event) => { show(JSON.parse(event.data)); };
    socket.onclose = () => {
      status.textContent = "not connected; trying again";
      status.style.display = "block";
      setTimeout(connect, retry);
      retry = Math.min(5000, 2 * retry);
    };
  };
  connect();

  // On a phone the panel hides the robot: it is closed at first, and opens when its title is tapped.
  const close = () => {
    const title = Array.from(document.querySelectorAll("#root *")).find(
      (element) => element.childElementCount === 0 && element.textContent === "m2wr live view");
    if (title) { title.click(); } else { setTimeout(close, 200); }
  };
  if (matchMedia("(max-width: 36em)").matches) { close(); }     // the width up to which viser puts the panel below
})();
