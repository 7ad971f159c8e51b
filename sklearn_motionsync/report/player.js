
// -- the player ------------------------------------------------------------------------------

function play(set) {
  const find = (id) => document.getElementById(id);
  const stage = find("stage"), time = find("time"), button = find("play");
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
  const positions = new Int16Array(bytes(set.positions));
  const warps = set.warps === null ? null : new Uint16Array(bytes(set.warps));
  const perFrame = set.points * set.dims, missing = -32768;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const starts = [0];
  for (const count of set.lengths) starts.push(starts[starts.length - 1] + count * perFrame);
  let share = 0, before = null, angle = 0, room = null, scale = 1, cells = [];

  const chosenPace = () => document.querySelector("input[name=pace]:checked").value;
  const isAligned = () => warps !== null && chosenPace() === "aligned";
  const shown = () => cells.map((cell) => cell.i);
  const longest = () => Math.max(...shown().map((i) => set.durations[i]));
  const frames = () => (isAligned() ? set.frames : Math.max(...shown().map((i) => set.lengths[i])));
  const timeText = (t) => (set.seconds ? t.toFixed(2) + " s" : "frame " + t.toFixed(0));
  const clamp = (value) => Math.min(1, Math.max(0, value));

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
    const moment = own(i) * (set.lengths[i] - 1), low = Math.floor(moment);
    const a = starts[i] + low * perFrame;
    const b = starts[i] + Math.min(low + 1, set.lengths[i] - 1) * perFrame;
    const points = [];
    for (let p = 0; p < perFrame; p += set.dims) {
      points.push(view((d) => {
        const start = positions[a + p + d], end = positions[b + p + d];
        return start === missing || end === missing ? NaN : start + (moment - low) * (end - start);
      }));
    }
    return points;
  }

  // -- places ------------------------------------------------------------------------------

  // The left, the right and the upper end of all trials that are shown, in all frames.
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
    arrange();
  }

  // As many columns as make the bodies largest.
  function arrange() {
    const [left, right, top] = room, ratio = window.devicePixelRatio || 1, caption = 48, margin = 10;
    const width = stage.clientWidth, high = Math.min(600, Math.max(340, 0.65 * window.innerHeight));
    scale = 0;
    let columns = 1;
    for (let n = 1; n <= cells.length; n++) {
      const rows = Math.ceil(cells.length / n);
      const fits = Math.min(
        (width / n - 2 * margin) / (right - left),
        (Math.max(high / rows, 110) - caption - margin) / top,
      );
      if (fits > scale) [scale, columns] = [fits, n];
    }
    stage.style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
    for (const { canvas } of cells) {
      canvas.style.height = Math.ceil(scale * top + margin + 6) + "px";
      canvas.width = Math.round(canvas.clientWidth * ratio);
      canvas.height = Math.round(canvas.clientHeight * ratio);
    }
    draw();
  }

  function draw() {
    const ratio = window.devicePixelRatio || 1, [left, right] = room;
    const colors = set.colors[dark.matches ? "dark" : "light"];
    for (const { i, canvas, label } of cells) {
      const pen = canvas.getContext("2d"), points = pose(i);
      const width = canvas.width / ratio, floor = canvas.height / ratio - 4;
      const place = ([x, y]) => [width / 2 + (x - (left + right) / 2) * scale, floor - y * scale];
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.clearRect(0, 0, width, floor + 4);
      pen.lineWidth = 1;
      pen.strokeStyle = "#808080";
      pen.beginPath();
      pen.moveTo(0, floor + 1.5);
      pen.lineTo(width, floor + 1.5);
      pen.stroke();
      pen.lineWidth = scale * room[2] < 130 ? 2 : 3;
      pen.lineCap = "round";
      for (const [side, bones] of set.bones) {
        pen.strokeStyle = colors[side];
        pen.beginPath();
        for (const [from, to] of bones) {
          if (points[from] && points[to]) {
            pen.moveTo(...place(points[from]));
            pen.lineTo(...place(points[to]));
          }
        }
        pen.stroke();
      }
      pen.fillStyle = colors.middle;
      for (const dot of set.dots.filter((p) => points[p])) {
        pen.beginPath();
        pen.arc(...place(points[dot]), set.dots.length > 1 ? 2.5 : pen.lineWidth * 1.7, 0, 2 * Math.PI);
        pen.fill();
      }
      label.textContent = timeText(own(i) * set.durations[i]);
    }
    time.value = Math.round(share * time.max);
    const whole = isAligned() ? "At " + (100 * share).toFixed(0) + " % of the pattern"
      : (set.seconds ? "After " : "At ") + timeText(share * longest());
    const each = shown().map((i) => set.names[i] + " is at " + (100 * own(i)).toFixed(0) + " %");
    find("moment").textContent = whole + (each.length > 3 ? "" : ", trial " + each.join(", and trial ")) + ".";
    time.setAttribute("aria-valuetext", whole);
  }

  // -- what is shown -----------------------------------------------------------------------

  function choose(chosen) {
    stage.replaceChildren();
    cells = chosen.map((i) => {
      const cell = document.createElement("figure"), canvas = document.createElement("canvas");
      const caption = document.createElement("figcaption"), label = document.createElement("span");
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", "Stick figure of trial " + set.names[i]);
      caption.append(set.names[i], label);
      cell.append(canvas, caption);
      stage.append(cell);
      return { i, canvas, label };
    });
    find("shown").textContent = `Trials: ${chosen.length} of ${set.names.length}`;
    const boxes = [...find("choice").querySelectorAll("input")];
    for (const box of boxes) {
      box.checked = chosen.includes(Number(box.value));
      // One at least, and not too many.
      box.disabled = box.checked ? chosen.length === 1 : chosen.length >= set.most;
    }
    pace();
    measure();
  }

  function pace() {
    time.max = frames() - 1;
    const marks = find("marks");
    marks.replaceChildren();
    for (const { name, own: at, clock } of set.keyframes) {
      for (const place of isAligned() ? [clock] : shown().map((i) => moment(at, i))) {
        if (place === null) continue;
        const mark = document.createElement("i");
        mark.title = name;
        mark.style.setProperty("--at", place);
        marks.append(mark);
      }
    }
  }

  // The share of the time that is over when a trial has a key-frame.
  const moment = (at, i) => (at[i] === null ? null : (at[i] * set.durations[i]) / longest());

  function toKeyframe({ own: at, clock }) {
    const known = shown().map((i) => moment(at, i)).filter((place) => place !== null);
    known.sort((a, b) => a - b);
    const middle = known.length ? known[Math.floor((known.length - 1) / 2)] : null;
    const to = isAligned() ? clock : middle;
    if (to !== null) move(to);
  }

  // -- time --------------------------------------------------------------------------------

  function step(now) {
    if (before === null) return;
    const length = set.pace * (isAligned() ? set.median : longest());
    share += ((now - before) / 1000) * Number(find("speed").value) / length;
    before = now;
    if (share >= 1) {
      if (find("loop").checked) share %= 1;
      else {
        share = 1;
        run(false);
      }
    }
    draw();
    requestAnimationFrame(step);
  }

  function run(on) {
    if (on === (before !== null)) return;
    if (on && share >= 1) share = 0;
    before = on ? performance.now() : null;
    button.textContent = on ? "Pause" : "Play";
    if (on) requestAnimationFrame(step);
  }

  function move(to) {
    run(false);
    share = clamp(to);
    draw();
  }

  set.names.forEach((name, i) => {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.value = i;
    box.addEventListener("change", () => {
      const boxes = [...find("choice").querySelectorAll("input:checked")];
      choose(boxes.map((one) => Number(one.value)));
    });
    label.className = "radio";
    label.append(box, " " + name);
    find("choice").append(label);
  });
  for (const keyframe of set.keyframes) {
    const jump = document.createElement("button");
    jump.type = "button";
    jump.textContent = keyframe.name;
    jump.addEventListener("click", () => toKeyframe(keyframe));
    find("jumps").append(jump);
  }
  find("jumps").hidden = set.keyframes.length === 0;
  find("others").hidden = set.names.length < 2;
  find("paces").hidden = warps === null;
  find("view").hidden = find("from").parentElement.hidden = set.dims === 2;
  button.addEventListener("click", () => run(before === null));
  time.addEventListener("input", () => move(time.value / time.max));
  find("turn").addEventListener("input", () => {
    const known = [...find("from").options].some((option) => option.value === find("turn").value);
    find("from").value = known ? find("turn").value : "";
    measure();
  });
  find("from").addEventListener("change", () => {
    find("turn").value = find("from").value;
    measure();
  });
  document.querySelectorAll("input[name=pace]").forEach((one) => one.addEventListener("change", () => {
    pace();
    draw();
  }));
  const onKey = (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const steps = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 };
    if (event.key === " ") run(before === null);
    else if (event.key in steps) move(share + steps[event.key] / (frames() - 1));
    else if (event.key === "Home" || event.key === "End") move(event.key === "End" ? 1 : 0);
    else return;
    event.preventDefault();
  };
  stage.addEventListener("keydown", onKey);
  // Where the page is nothing but the player, its keys need no focus.
  document.addEventListener("keydown", (event) => {
    if (set.alone && event.target === document.body) onKey(event);
  });
  stage.addEventListener("click", () => run(before === null));
  window.addEventListener("resize", arrange);
  dark.addEventListener("change", draw);
  choose(set.shown);
}

if (page.player) play(page.player);
