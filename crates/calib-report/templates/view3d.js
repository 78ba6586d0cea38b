"use strict";
(function () {
  const view = JSON.parse(document.getElementById("view-data").textContent);
  const canvas = document.getElementById("canvas");
  const ink = canvas.getContext && canvas.getContext("2d");
  if (!ink) return; // The still picture stays.
  document.getElementById("still").hidden = true;
  document.getElementById("live").hidden = false;

  // The camera looks at `target`; angles in rad, z is up.
  const start = { turn: -0.9, tilt: 0.42, zoom: 1, target: [0, 0, 0] };
  const camera = Object.assign({}, start);
  let labels = [], picked = -1;
  let size = 1, floor = 0, pose = 0, colors = {}, factor = view.magnification;
  const layers = [
    ["calibrated", "Calibrated", "s0", true], ["solids", "Shapes", "body", true], ["nominal", "Nominal", "s1", true], ["markers", "Markers", "s3", true],
    ["residuals", "Errors", "bad", true], ["sweeps", "Sweeps", "soft", false], ["joints", "Spheres, circles, axes", "s2", !view.poses.length], ["names", "Names and axes", "ink", false],
  ];
  const shown = {};

  // What the picture has to hold in a pose: frames, markers and shapes; where there is none, the sweeps.
  function places(p) {
    const all = [];
    if (!p) for (const cloud of view.clouds) for (const point of cloud.points) all.push(point);
    if (!p) return all;
    for (const row of p.calibrated) all.push(row);
    for (const m of p.markers) all.push(m.observed || m.predicted);
    for (const solid of view.solids) { const row = p.calibrated[solid.frame], q = row.slice(3); for (const point of solid.points) all.push(add(row, rotate(q, point), 1)); }
    return all;
  }
  function ends(all) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const p of all) for (let i = 0; i < 3; i++) { low[i] = Math.min(low[i], p[i]); high[i] = Math.max(high[i], p[i]); }
    return [low, high];
  }
  // Look at the robot as it stands, as large as it goes; perspective needs a second and third look.
  function reset() {
    const all = places(view.poses[pose]), [low, high] = ends(all);
    if (low[0] <= high[0]) {
      start.target = low.map(function (x, i) { return (x + high[i]) / 2; });
      size = Math.max(1e-3, Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]));
      floor = low[2];
    }
    Object.assign(camera, start, { target: start.target.slice() });
    for (let i = 0; i < 3; i++) {
      let reach = 0;
      for (const p of all) {
        const at = project(p);
        if (at) reach = Math.max(reach, Math.abs(at[0] / canvas.clientWidth - 0.5), Math.abs(at[1] / canvas.clientHeight - 0.5));
      }
      if (reach > 0) camera.zoom *= 0.45 / reach;
    }
    camera.zoom = Math.max(0.2, Math.min(60, camera.zoom));
    draw();
  }

  // World to picture: [x, y, pixels per meter at that depth], or null behind the camera.
  function project(p) {
    const x = p[0] - camera.target[0], y = p[1] - camera.target[1], z = p[2] - camera.target[2];
    const ct = Math.cos(camera.turn), st = Math.sin(camera.turn), ce = Math.cos(camera.tilt), se = Math.sin(camera.tilt);
    const right = ct * x - st * y, away = st * x + ct * y;
    const up = ce * z + se * away, depth = ce * away - se * z + 1.9 * size / camera.zoom;
    if (depth < 0.02 * size) return null;
    const scale = 1.35 * Math.min(canvas.clientWidth, canvas.clientHeight * 1.3) / depth;
    return [canvas.clientWidth / 2 + right * scale, canvas.clientHeight / 2 - up * scale, scale];
  }
  function rotate(q, v) {
    const [x, y, z, w] = q, tx = 2 * (y * v[2] - z * v[1]), ty = 2 * (z * v[0] - x * v[2]), tz = 2 * (x * v[1] - y * v[0]);
    return [v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx];
  }
  function add(a, b, k) { return [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]]; }
  function line(a, b, color, width, dash) {
    const p = project(a), q = project(b);
    if (!p || !q) return;
    ink.strokeStyle = color; ink.lineWidth = width; ink.setLineDash(dash || []);
    ink.beginPath(); ink.moveTo(p[0], p[1]); ink.lineTo(q[0], q[1]); ink.stroke();
  }
  function dot(a, color, radius, hollow) {
    const p = project(a);
    if (!p) return;
    ink.setLineDash([]); ink.beginPath(); ink.arc(p[0], p[1], radius, 0, 7);
    if (hollow) { ink.strokeStyle = color; ink.lineWidth = 1.5; ink.stroke(); } else { ink.fillStyle = color; ink.fill(); }
  }
  function text(a, words, color) {
    const p = project(a);
    if (p) labels.push([p, words, color]);
  }
  // A label stands at the first of four places beside its point where no other stands; else it is left out.
  function drawLabels() {
    const taken = [], high = 13;
    for (const [p, words, color] of labels) {
      const wide = ink.measureText(words).width;
      const free = [[6, -5], [6, 14], [-wide - 6, -5], [-wide - 6, 14]].map(function (d) { return [p[0] + d[0], p[1] + d[1] - high, wide, high]; }).find(function (r) {
        return r[0] >= 0 && r[0] + wide <= canvas.clientWidth && !taken.some(function (t) { return r[0] < t[0] + t[2] && t[0] < r[0] + wide && r[1] < t[1] + high && t[1] < r[1] + high; });
      });
      if (!free) continue;
      taken.push(free);
      ink.fillStyle = color; ink.fillText(words, free[0], free[1] + high - 2);
    }
    canvas.dataset.labels = JSON.stringify(taken.map(function (r) { return r.map(Math.round); }));
    labels = [];
  }
  // A bar of a round length at the depth that the camera looks at.
  function drawScale() {
    const p = project(camera.target);
    if (!p) return;
    const power = Math.pow(10, Math.floor(Math.log10(120 / p[2]))), digit = [5, 2, 1].find(function (d) { return d * power * p[2] <= 120; }) || 1;
    const meters = digit * power, y = canvas.clientHeight - 14;
    ink.setLineDash([]); ink.strokeStyle = colors.ink; ink.lineWidth = 2; ink.beginPath();
    ink.moveTo(14, y - 4); ink.lineTo(14, y); ink.lineTo(14 + meters * p[2], y); ink.lineTo(14 + meters * p[2], y - 4); ink.stroke();
    ink.fillStyle = colors.ink; ink.fillText(meters >= 1 ? meters + " m" : Math.round(meters * 1e6) / 1e3 + " mm", 14, y - 8);
  }
  // The directions of the frame that everything is in.
  function drawTriad() {
    const ct = Math.cos(camera.turn), st = Math.sin(camera.turn), ce = Math.cos(camera.tilt), se = Math.sin(camera.tilt);
    const x = canvas.clientWidth - 44, y = canvas.clientHeight - 40;
    [["x", ct, se * st], ["y", -st, se * ct], ["z", 0, ce]].forEach(function ([name, right, up]) {
      ink.setLineDash([]); ink.strokeStyle = colors.ink; ink.lineWidth = 1.5; ink.beginPath(); ink.moveTo(x, y); ink.lineTo(x + 26 * right, y - 26 * up); ink.stroke();
      ink.fillStyle = colors.ink; ink.fillText(name, x + 34 * right - 3, y - 34 * up + 4);
    });
  }
  // The residual of a marker in words, and a ring about it.
  function pick(i) {
    const markers = view.poses[pose] ? view.poses[pose].markers : [];
    picked = markers[i] ? i : -1;
    const m = markers[i];
    if (m) {
      const e = m.residual_mm;
      const mm = function (x) { return x.toFixed(2).replace("-", "\u2212"); };
      document.getElementById("view-status").textContent = m.name + ": " + (view.planned ? (e ? "in sight" : "not in sight") : e ? "predicted minus measured " + mm(Math.hypot(e[0], e[1], e[2])) + " mm (x " + mm(e[0]) + ", y " + mm(e[1]) + ", z " + mm(e[2]) + " mm)" : "not seen by the tracker");
    }
    draw();
  }
  function nearest(x, y) {
    let best = -1, distance = 16;
    (view.poses[pose] ? view.poses[pose].markers : []).forEach(function (m, i) {
      for (const place of [m.observed, m.predicted]) {
        const p = place && project(place), d = p ? Math.hypot(p[0] - x, p[1] - y) : Infinity;
        if (d < distance) { distance = d; best = i; }
      }
    });
    return best;
  }
  function across(n) {
    const helper = Math.abs(n[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    const u = cross(n, helper), k = 1 / (Math.hypot(u[0], u[1], u[2]) || 1), a = [u[0] * k, u[1] * k, u[2] * k];
    return [a, cross(n, a)];
  }
  function cross(a, b) { return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]; }
  function ring(center, normal, radius, color, width, dash) {
    const [u, v] = across(normal);
    ink.strokeStyle = color; ink.lineWidth = width; ink.setLineDash(dash || []); ink.beginPath();
    for (let i = 0; i <= 48; i++) {
      const t = i / 48 * 2 * Math.PI, p = project(add(add(center, u, radius * Math.cos(t)), v, radius * Math.sin(t)));
      if (!p) return;
      if (i) ink.lineTo(p[0], p[1]); else ink.moveTo(p[0], p[1]);
    }
    ink.stroke();
  }
  function arrow(from, to, color) {
    line(from, to, color, 2);
    const p = project(from), q = project(to);
    if (!p || !q) return;
    const dx = q[0] - p[0], dy = q[1] - p[1], length = Math.hypot(dx, dy);
    if (length < 3) return;
    const h = Math.min(9, length / 2) / length;
    ink.setLineDash([]); ink.beginPath(); ink.moveTo(q[0] - h * (dx + dy * 0.5), q[1] - h * (dy - dx * 0.5)); ink.lineTo(q[0], q[1]); ink.lineTo(q[0] - h * (dx - dy * 0.5), q[1] - h * (dy + dx * 0.5)); ink.stroke();
  }

  function drawFloor() {
    const step = Math.pow(10, Math.floor(Math.log10(size / 2))), half = Math.ceil(size / step / 2) * step;
    const cx = Math.round(start.target[0] / step) * step, cy = Math.round(start.target[1] / step) * step;
    for (let k = -half; k <= half + step / 2; k += step) {
      line([cx + k, cy - half, floor], [cx + k, cy + half, floor], colors.line, 1);
      line([cx - half, cy + k, floor], [cx + half, cy + k, floor], colors.line, 1);
    }
  }
  function drawRobot(rows, color, width, dash) {
    view.frames.forEach(function (frame, i) {
      if (frame.parent !== null) line(rows[frame.parent], rows[i], color, width, dash);
    });
  }
  // Filled faces, each pixel of the nearest one, at twice the pixels of the picture: the browser smooths the edges.
  const fine = { canvas: document.createElement("canvas"), wide: 0, high: 0 };
  function drawSolids(rows) {
    const k = 2, wide = k * canvas.clientWidth, high = k * canvas.clientHeight;
    if (!wide || !high) return;
    const to = fine.canvas.getContext("2d");
    if (fine.wide !== wide || fine.high !== high) {
      Object.assign(fine, { wide, high });
      Object.assign(fine.canvas, { width: wide, height: high });
      fine.image = to.createImageData(wide, high);
      fine.pixels = new Uint32Array(fine.image.data.buffer);
      fine.near = new Float32Array(wide * high);
    }
    fine.pixels.fill(0); fine.near.fill(0);
    const ct = Math.cos(camera.turn), st = Math.sin(camera.turn), ce = Math.cos(camera.tilt), se = Math.sin(camera.tilt);
    const eye = [-ce * st, -ce * ct, se], light = [eye[0] + 0.5 * se * st - 0.4 * ct, eye[1] + 0.5 * se * ct + 0.4 * st, eye[2] + 0.5 * ce];
    const base = [1, 3, 5].map(function (i) { return parseInt(colors.body.slice(i, i + 2), 16); });
    for (const solid of view.solids) {
      const row = rows[solid.frame], q = row.slice(3);
      const places = solid.points.map(function (p) { return add(row, rotate(q, p), 1); }), seen = places.map(project);
      for (const face of solid.faces) {
        if (face.some(function (i) { return !seen[i]; })) continue;
        const [a, b, c] = face.map(function (i) { return places[i]; });
        const n = cross(add(b, a, -1), add(c, a, -1)), long = Math.hypot(n[0], n[1], n[2]);
        if (!long) continue;
        // Files do not agree which side of a face is outside: the side that is seen has the light.
        const side = dot3(n, eye) < 0 ? -1 : 1, bright = Math.max(0, side * dot3(n, light) / long / Math.hypot(light[0], light[1], light[2]));
        const rgb = base.map(function (x) { return Math.round(x * (0.4 + 0.6 * bright)); });
        const color = (255 << 24 | rgb[2] << 16 | rgb[1] << 8 | rgb[0]) >>> 0;
        for (let i = 1; i + 1 < face.length; i++) fill(seen[face[0]], seen[face[i]], seen[face[i + 1]], color, k);
      }
    }
    to.putImageData(fine.image, 0, 0);
    ink.drawImage(fine.canvas, 0, 0, wide / k, high / k);
  }
  // A triangle of [x, y, 1 / distance]; the last is linear in the picture.
  function fill(a, b, c, color, k) {
    const x0 = k * a[0], y0 = k * a[1], x1 = k * b[0] - x0, y1 = k * b[1] - y0, x2 = k * c[0] - x0, y2 = k * c[1] - y0;
    const area = x1 * y2 - x2 * y1;
    if (!area) return;
    const top = Math.max(0, Math.ceil(y0 + Math.min(0, y1, y2) - 0.5)), low = Math.min(fine.high - 1, Math.floor(y0 + Math.max(0, y1, y2) - 0.5));
    const left = Math.max(0, Math.ceil(x0 + Math.min(0, x1, x2) - 0.5)), right = Math.min(fine.wide - 1, Math.floor(x0 + Math.max(0, x1, x2) - 0.5));
    for (let y = top; y <= low; y++) {
      const dy = y + 0.5 - y0;
      for (let x = left; x <= right; x++) {
        const dx = x + 0.5 - x0, u = (dx * y2 - x2 * dy) / area, v = (x1 * dy - dx * y1) / area;
        if (u < 0 || v < 0 || u + v > 1) continue;
        const at = y * fine.wide + x, near = a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2]);
        if (near > fine.near[at]) { fine.near[at] = near; fine.pixels[at] = color; }
      }
    }
  }
  function dot3(a, b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
  function drawAxes(rows) {
    const long = size * 0.035, names = [colors.bad, colors.s2, colors.s0];
    rows.forEach(function (row) {
      for (let k = 0; k < 3; k++) { const e = [0, 0, 0]; e[k] = long; line(row, add(row, rotate(row.slice(3), e), 1), names[k], 1.5); }
    });
  }
  // An axis of a joint moves with the calibrated robot.
  function inWorld(a) {
    if (a.frame === null) return a;
    const row = view.poses[pose] && view.poses[pose].calibrated[a.frame];
    return row && Object.assign({}, a, { point: add(row, rotate(row.slice(3), a.point), 1), direction: rotate(row.slice(3), a.direction) });
  }
  function drawJoints() {
    for (const s of view.spheres) {
      for (const n of [[1, 0, 0], [0, 1, 0], [0, 0, 1]]) ring(s.center, n, s.radius, colors.s2, 0.7);
      dot(s.center, colors.s2, 3);
      if (s.sigma) for (const n of [[1, 0, 0], [0, 1, 0], [0, 0, 1]]) ring(s.center, n, factor * s.sigma, colors.bad, 1, [3, 3]);
      if (shown.names) text(s.center, s.name, colors.s2);
    }
    for (const c of view.circles) ring(c.center, c.normal, c.radius, colors.s2, 1);
    for (const axis of view.axes) {
      const a = inWorld(axis);
      if (!a) continue;
      const ends = [-1, 1].map(function (sign) { return add(a.point, a.direction, sign * a.half_length); });
      line(ends[0], ends[1], colors.s2, 2);
      const sigma = Math.hypot(a.sigma_point || 0, (a.sigma_direction || 0) * a.half_length);
      if (sigma > 0) {
        for (const end of ends) ring(end, a.direction, factor * sigma, colors.bad, 1, [3, 3]);
        ring(a.point, a.direction, factor * (a.sigma_point || 0), colors.bad, 1, [3, 3]);
      }
      if (shown.names) text(ends[1], a.name, colors.s2);
    }
  }
  function draw() {
    const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) { canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio); }
    ink.setTransform(ratio, 0, 0, ratio, 0, 0);
    ink.fillStyle = colors.paper; ink.fillRect(0, 0, w, h);
    ink.font = "12px system-ui, sans-serif"; ink.lineCap = "round";
    drawFloor();
    if (shown.sweeps) for (const cloud of view.clouds) {
      ink.globalAlpha = 0.55;
      for (const p of cloud.points) dot(p, colors.soft, 1.3);
      ink.globalAlpha = 1;
    }
    if (shown.joints) drawJoints();
    const now = view.poses[pose];
    if (now) drawNow(now);
    drawScale();
    drawTriad();
    drawLabels();
  }
  function drawNow(now) {
    const filled = shown.solids && view.solids.length;
    if (filled) drawSolids(now.calibrated);
    if (shown.calibrated) { drawRobot(now.calibrated, colors.s0, filled ? 2 : 4); if (shown.names) drawAxes(now.calibrated); for (const row of now.calibrated) dot(row, colors.s0, 3.5); }
    if (shown.nominal && now.nominal.length) drawRobot(now.nominal, colors.s1, 2, [6, 5]);
    for (const m of now.markers) {
      if (shown.markers) { if (m.observed) dot(m.observed, colors.s3, 4); dot(m.predicted, colors.s3, 5.5, true); }
      if (m === now.markers[picked]) { dot(m.observed || m.predicted, colors.ink, 9, true); text(m.observed || m.predicted, m.name, colors.ink); }
      if (shown.residuals && m.observed) arrow(m.observed, add(m.observed, [0, 1, 2].map(function (i) { return m.predicted[i] - m.observed[i]; }), factor), colors.bad);
    }
    if (shown.names && shown.calibrated) view.frames.forEach(function (frame, i) { text(now.calibrated[i], frame.name, colors.ink); });
  }

  function readColors() {
    const style = getComputedStyle(document.documentElement);
    for (const name of ["paper", "ink", "soft", "line", "body", "bad", "s0", "s1", "s2", "s3"]) colors[name] = style.getPropertyValue("--" + name).trim();
    draw();
  }
  function setPose(i) {
    pose = Math.max(0, Math.min(view.poses.length - 1, i));
    picked = -1;
    const now = view.poses[pose], slider = document.getElementById("pose");
    if (slider) slider.value = pose;
    const words = now ? "Pose " + (pose + 1) + " of " + view.poses.length + ": " + now.name + (now.text ? ", " + now.text : "") : "";
    if (slider) slider.setAttribute("aria-valuetext", words);
    document.getElementById("view-status").textContent = words;
    draw();
  }
  function turn(dx, dy) { camera.turn += dx; camera.tilt = Math.max(-1.5, Math.min(1.55, camera.tilt + dy)); draw(); }
  function move(dx, dy) {
    const k = size / camera.zoom / 500, ct = Math.cos(camera.turn), st = Math.sin(camera.turn);
    const ce = Math.cos(camera.tilt), se = Math.sin(camera.tilt);
    camera.target = add(add(camera.target, [ct, -st, 0], -dx * k), [se * st, se * ct, ce], dy * k);
    draw();
  }
  function zoom(by) { camera.zoom = Math.max(0.2, Math.min(60, camera.zoom * by)); draw(); }

  for (const [id, name, color, on] of layers) {
    if (id === "solids" && !view.solids.length) continue;
    shown[id] = on;
    const label = document.createElement("label"), box = document.createElement("input"), swatch = document.createElement("i");
    box.type = "checkbox"; box.checked = on; swatch.style.background = "var(--" + color + ")"; swatch.setAttribute("aria-hidden", "true");
    box.addEventListener("change", function () { shown[id] = box.checked; draw(); });
    label.append(box, swatch, name);
    document.getElementById("layers").append(label);
  }
  const slider = document.getElementById("pose");
  if (slider) slider.addEventListener("input", function () { setPose(Number(slider.value)); });
  const magnify = document.getElementById("factor");
  magnify.value = Math.log10(Math.max(1, factor));
  magnify.addEventListener("input", function () {
    factor = Math.round(Math.pow(10, Number(magnify.value)));
    document.getElementById("factor-text").textContent = factor;
    draw();
  });
  document.getElementById("reset").addEventListener("click", reset);

  const touches = new Map();
  let pressed = null;
  canvas.addEventListener("pointerdown", function (e) { pressed = [e.clientX, e.clientY]; touches.set(e.pointerId, [e.clientX, e.clientY]); canvas.setPointerCapture(e.pointerId); });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, function (e) { touches.delete(e.pointerId); });
  canvas.addEventListener("pointerup", function (e) {
    const box = canvas.getBoundingClientRect();
    if (!pressed || Math.hypot(e.clientX - pressed[0], e.clientY - pressed[1]) > 4) return;
    const i = nearest(e.clientX - box.left, e.clientY - box.top);
    if (i >= 0) pick(i);
  });
  canvas.addEventListener("pointermove", function (e) {
    const before = touches.get(e.pointerId);
    if (!before) return;
    const dx = e.clientX - before[0], dy = e.clientY - before[1];
    if (touches.size === 2) {
      const other = [...touches].find(function (t) { return t[0] !== e.pointerId; })[1];
      const apart = Math.hypot(e.clientX - other[0], e.clientY - other[1]), was = Math.hypot(before[0] - other[0], before[1] - other[1]);
      if (was > 0) zoom(apart / was);
    } else if (e.shiftKey || e.buttons === 2 || e.buttons === 4) move(dx, dy); else turn(dx * 0.008, dy * 0.008);
    touches.set(e.pointerId, [e.clientX, e.clientY]);
  });
  canvas.addEventListener("contextmenu", function (e) { e.preventDefault(); });
  canvas.addEventListener("wheel", function (e) { e.preventDefault(); zoom(Math.exp(-e.deltaY * 0.0012)); }, { passive: false });
  canvas.addEventListener("keydown", function (e) {
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
    if (arrows && e.shiftKey) move(arrows[0] * 20, arrows[1] * 20);
    else if (arrows) turn(arrows[0] * 0.1, arrows[1] * 0.1);
    else if (e.key === "+" || e.key === "=") zoom(1.15);
    else if (e.key === "-") zoom(1 / 1.15);
    else if (e.key === "0") reset();
    else if (e.key === "m" || e.key === "M") { const n = view.poses[pose] ? view.poses[pose].markers.length : 0; if (n) pick((picked + (e.key === "m" ? 1 : n - 1) + n) % n); }
    else if (e.key === "PageUp") setPose(pose - 1);
    else if (e.key === "PageDown") setPose(pose + 1);
    else return;
    e.preventDefault();
  });

  readColors();
  reset();
  setPose(0);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColors);
  window.addEventListener("beforeprint", readColors);
  window.addEventListener("afterprint", readColors);
  if (window.ResizeObserver) new ResizeObserver(draw).observe(canvas); else window.addEventListener("resize", draw);
  canvas.dataset.ready = "yes";
})();
