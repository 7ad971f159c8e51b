"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);

  // -- tables as files ---------------------------------------------------------------------

  function save(name, text) {
    // Spreadsheets read other letters than ASCII only behind a mark.
    const mark = /[^\x00-\x7f]/.test(text) ? "\ufeff" : "";
    const address = URL.createObjectURL(new Blob([mark, text], { type: "text/csv;charset=utf-8" }));
    const link = document.createElement("a");
    link.href = address;
    link.download = name;
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(address), 60000);
  }

  for (const button of document.querySelectorAll("button[data-file]")) {
    const name = button.dataset.file;
    button.addEventListener("click", () => save(name, data.files[name]));
  }

  // -- the player --------------------------------------------------------------------------

  function bytes(text) {
    return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
  }

  function play(set) {
    const find = (id) => document.getElementById(id);
    const canvas = find("stage"), time = find("time"), button = find("play");
    const positions = new Int16Array(bytes(set.positions)), warps = new Uint16Array(bytes(set.warps));
    const perFrame = set.points * set.dims, missing = -32768;
    const starts = [0];
    for (const count of set.counts) starts.push(starts[starts.length - 1] + count * perFrame);
    let share = 0, before = null, room = null, angle = 0;

    const shown = () => [Number(find("left").value), Number(find("right").value)];
    const isAligned = () => document.querySelector("input[name=pace]:checked").value === "aligned";
    const longest = () => Math.max(...shown().map((i) => set.durations[i]));
    const time_text = (t) => (set.seconds ? t.toFixed(2) + " s" : "frame " + t.toFixed(0));

    // The share of a trial that is over.
    function own(i) {
      if (!isAligned()) return Math.min(1, (share * longest()) / set.durations[i]);
      const at = share * (set.frames - 1), low = Math.floor(at);
      const start = warps[i * set.frames + low];
      const end = warps[i * set.frames + Math.min(low + 1, set.frames - 1)];
      return (start + (at - low) * (end - start)) / 65535;
    }

    // The place of a point from its coordinates, as it is seen; null where one is not known.
    function view(at) {
      const x = set.dims === 2 ? at(0) : at(0) * Math.cos(angle) - at(2) * Math.sin(angle);
      return Number.isFinite(x + at(1)) ? [x * set.scale, at(1) * set.scale] : null;
    }

    // The points of a trial at its moment, between two frames.
    function pose(i) {
      const moment = own(i) * (set.counts[i] - 1), low = Math.floor(moment);
      const a = starts[i] + low * perFrame;
      const b = starts[i] + Math.min(low + 1, set.counts[i] - 1) * perFrame;
      const points = [];
      for (let p = 0; p < perFrame; p += set.dims) {
        points.push(view((d) => {
          const start = positions[a + p + d], end = positions[b + p + d];
          return start === missing || end === missing ? NaN : start + (moment - low) * (end - start);
        }));
      }
      return points;
    }

    // The left, the right and the upper end of both trials, in all frames.
    function measure() {
      angle = (Number(find("turn").value) * Math.PI) / 180;
      let left = Infinity, right = -Infinity, top = 0;
      for (const i of shown()) {
        for (let k = starts[i]; k < starts[i + 1]; k += set.dims) {
          const place = view((d) => (positions[k + d] === missing ? NaN : positions[k + d]));
          if (!place) continue;
          left = Math.min(left, place[0]);
          right = Math.max(right, place[0]);
          top = Math.max(top, place[1]);
        }
      }
      room = [left, right, top];
      draw();
    }

    function draw() {
      const ratio = window.devicePixelRatio || 1;
      const width = canvas.clientWidth, height = canvas.clientHeight, floor = height - 44;
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
      const pen = canvas.getContext("2d");
      pen.scale(ratio, ratio);
      const [left, right, top] = room;
      const scale = Math.min((width / 2 - 16) / (right - left), (floor - 16) / top);
      pen.strokeStyle = "#999999";
      pen.beginPath();
      pen.moveTo(0, floor);
      pen.lineTo(width, floor);
      pen.stroke();
      shown().forEach((i, side) => {
        const middle = (width * (2 * side + 1)) / 4;
        const place = ([x, y]) => [middle + (x - (left + right) / 2) * scale, floor - y * scale];
        const points = pose(i);
        pen.lineWidth = 3;
        pen.lineCap = "round";
        for (const [color, bones] of set.bones) {
          pen.strokeStyle = color;
          pen.beginPath();
          for (const [from, to] of bones) {
            if (points[from] && points[to]) {
              pen.moveTo(...place(points[from]));
              pen.lineTo(...place(points[to]));
            }
          }
          pen.stroke();
        }
        pen.fillStyle = set.dotColor;
        for (const dot of set.dots.filter((p) => points[p])) {
          pen.beginPath();
          pen.arc(...place(points[dot]), set.dots.length > 1 ? 2.5 : 5, 0, 2 * Math.PI);
          pen.fill();
        }
        pen.fillStyle = "#1a1a1a";
        pen.font = "15px system-ui, sans-serif";
        pen.textAlign = "center";
        pen.fillText(set.names[i], middle, height - 25, width / 2 - 8);
        pen.fillText(time_text(own(i) * set.durations[i]), middle, height - 7, width / 2 - 8);
      });
      time.value = Math.round(share * 1000);
      const whole = isAligned() ? "At " + (100 * share).toFixed(0) + " % of the template"
        : set.seconds ? "After " + time_text(share * longest()) : "At " + time_text(share * longest());
      const each = shown().map((i) => set.names[i] + " is at " + (100 * own(i)).toFixed(0) + " %");
      find("moment").textContent = whole + ", trial " + each.join(", and trial ") + ".";
      time.setAttribute("aria-valuetext", whole);
    }

    function step(now) {
      if (before === null) return;
      const length = set.pace * (isAligned() ? set.median : longest());
      share += ((now - before) / 1000) * Number(find("speed").value) / length;
      if (share >= 1) share = share % 1;
      before = now;
      draw();
      requestAnimationFrame(step);
    }

    function run(on) {
      if (on === (before !== null)) return;
      before = on ? performance.now() : null;
      button.textContent = on ? "Pause" : "Play";
      if (on) requestAnimationFrame(step);
    }

    function move(to) {
      run(false);
      share = Math.min(1, Math.max(0, to));
      draw();
    }

    for (const side of ["left", "right"]) {
      set.names.forEach((name, i) => find(side).append(new Option(name, i)));
      find(side).value = set[side];
      find(side).addEventListener("change", measure);
    }
    button.addEventListener("click", () => run(before === null));
    time.addEventListener("input", () => move(time.value / 1000));
    find("turn").addEventListener("input", measure);
    find("view").hidden = set.dims === 2;
    document.querySelectorAll("input[name=pace]").forEach((one) => one.addEventListener("change", draw));
    canvas.addEventListener("keydown", (event) => {
      const steps = { ArrowLeft: -0.01, ArrowRight: 0.01 };
      if (event.key === " ") run(before === null);
      else if (event.key in steps) move(share + steps[event.key]);
      else return;
      event.preventDefault();
    });
    canvas.addEventListener("click", () => run(before === null));
    window.addEventListener("resize", draw);
    measure();
  }

  if (data.player) play(data.player);
})();
