"use strict";
(function () {
  // Tables: a button in each heading sorts by data-sort, else by text; order returns on the third press.
  function key(row, column) {
    var cell = row.cells[column];
    var given = cell.getAttribute("data-sort");
    return given === null ? { text: cell.textContent.trim(), number: NaN } : { text: "", number: parseFloat(given) };
  }

  function compare(a, b) {
    var aKnown = !isNaN(a.number), bKnown = !isNaN(b.number);
    if (aKnown && bKnown) { return a.number - b.number; }
    if (aKnown !== bKnown) { return aKnown ? -1 : 1; }
    return a.text < b.text ? -1 : a.text > b.text ? 1 : 0;
  }

  function sortBy(table, heads, column, original) {
    var head = heads[column], before = head.getAttribute("aria-sort");
    var next = before === "ascending" ? "descending" : before === "descending" ? null : "ascending";
    heads.forEach(function (other) { other.removeAttribute("aria-sort"); });
    var rows = original.slice();
    if (next !== null) {
      head.setAttribute("aria-sort", next);
      var sign = next === "ascending" ? 1 : -1;
      rows.sort(function (a, b) { return sign * compare(key(a, column), key(b, column)); });
    }
    var body = table.tBodies[0];
    rows.forEach(function (row) { body.appendChild(row); });
  }

  document.querySelectorAll("table.sortable").forEach(function (table) {
    if (!table.tBodies.length || table.tBodies[0].rows.length < 2) { return; }
    var heads = Array.prototype.slice.call(table.tHead.rows[0].cells);
    var original = Array.prototype.slice.call(table.tBodies[0].rows);
    heads.forEach(function (head, column) {
      var button = document.createElement("button");
      button.type = "button";
      while (head.firstChild) { button.appendChild(head.firstChild); }
      head.appendChild(button);
      button.addEventListener("click", function () { sortBy(table, heads, column, original); });
    });
  });

  // Tables that stand as cards on a narrow screen stay tables for who listens to them.
  document.querySelectorAll(".cards table, .wide table").forEach(function (table) {
    [["thead, tbody", "rowgroup"], ["tr", "row"], ["thead th", "columnheader"], ["tbody th", "rowheader"], ["td", "cell"]]
      .forEach(function (pair) {
        table.querySelectorAll(pair[0]).forEach(function (part) { part.setAttribute("role", pair[1]); });
      });
    table.setAttribute("role", "table");
  });

  // A table that goes on beyond its frame stands as cards where that is as narrow as a phone, or closer, or says so.
  var phone = window.matchMedia("screen and (max-width: 34rem)"), tablet = window.matchMedia("screen and (max-width: 55.99rem)"), narrow = 31.5 * 16;
  function cut(frame) { return frame.scrollWidth > frame.clientWidth + 1; }
  function turn(frame, how) {
    if (!cut(frame)) { return; }
    frame.classList.add(how);
    frame.dataset.turned = (frame.dataset.turned || "") + " " + how;
  }
  function hint(frame) {
    (frame.dataset.turned || "").split(" ").filter(Boolean).forEach(function (how) { frame.classList.remove(how); });
    delete frame.dataset.turned;
    if (phone.matches || frame.clientWidth <= narrow) { turn(frame, "cards"); }
    turn(frame, "tight");
    if (tablet.matches) { turn(frame, "wide"); }
    turn(frame, "broken");
    var head = frame.querySelector("thead"), unseen = head && getComputedStyle(head).position === "absolute";
    frame.querySelectorAll("thead button").forEach(function (button) { button.tabIndex = unseen ? -1 : 0; });
    frame.classList.toggle("more", cut(frame));
    frame.classList.toggle("down", frame.matches(".inner, .long") && frame.scrollHeight > frame.clientHeight + 1);
  }
  var frames = Array.prototype.slice.call(document.querySelectorAll(".scroll, .inner"));
  if (window.ResizeObserver) {
    var watch = new ResizeObserver(function (seen) { seen.forEach(function (one) { hint(one.target); }); });
    frames.forEach(function (frame) { watch.observe(frame); });
  } else { frames.forEach(hint); }
  window.addEventListener("load", function () { frames.forEach(hint); });

  // A list of sections that goes on beyond the window says so.
  var sections = document.querySelector("nav ul");
  function listed() {
    var left = sections.scrollWidth - sections.clientWidth - sections.scrollLeft;
    sections.parentElement.classList.toggle("beyond", left > 1);
  }
  sections.addEventListener("scroll", listed, { passive: true });
  window.addEventListener("resize", listed);
  listed();

  // A part that a link leads to is opened.
  function open() {
    var place = location.hash.length > 1 ? document.getElementById(decodeURIComponent(location.hash.slice(1))) : null;
    if (!place) { return; }
    place.querySelectorAll("details.part").forEach(function (part) { part.open = true; });
    for (var at = place.parentElement; at; at = at.parentElement) { if (at.tagName === "DETAILS") { at.open = true; } }
    place.scrollIntoView();
  }
  window.addEventListener("hashchange", open);
  document.querySelectorAll("nav a, .banner a").forEach(function (link) {
    link.addEventListener("click", function () { window.setTimeout(open, 0); });
  });
  open();

  // Figures: what a point or a bar says shows under the pointer, and by arrow keys.
  var SVG = "http://www.w3.org/2000/svg", MANY = 1000, said = new Map();

  function span(text, bold) {
    var piece = document.createElement(bold ? "b" : "span");
    piece.textContent = text;
    return piece;
  }

  function tips(drawing) {
    var data = JSON.parse(drawing.dataset.points), svg = drawing.querySelector("svg");
    drawing.removeAttribute("data-points");
    said.set(drawing, data);
    var rows = data.rows, size = svg.viewBox.baseVal, shown = -1, tip = null, ring = null;
    var order = rows.map(function (_, k) { return k; }).sort(function (a, b) {
      return rows[a][0] - rows[b][0] || rows[a][1] - rows[b][1];
    });

    function hide() {
      if (tip) { tip.remove(); ring.remove(); tip = ring = null; }
      shown = -1;
    }

    // The ring stands above the figure, not in it: thousands of marks need not be painted again.
    function place() {
      ring = document.createElement("div");
      ring.className = "here";
      tip = document.createElement("div");
      tip.className = "tip";
      tip.setAttribute("role", "status");
      drawing.append(ring, tip);
    }

    function show(index) {
      if (index === shown) { return; }
      if (!tip) { place(); }
      shown = index;
      var row = rows[index], scale = svg.clientWidth / size.width || drawing.clientWidth / size.width;
      var room = row[2] || row[3] ? 1.5 : 5.5;
      [["left", row[0] - room], ["top", row[1] - room], ["width", row[2] + 2 * room], ["height", row[3] + 2 * room],
        ["borderRadius", row[2] || row[3] ? 1 : room]].forEach(function (pair) { ring.style[pair[0]] = pair[1] * scale + "px"; });
      tip.replaceChildren();
      data.labels.forEach(function (label, k) {
        var value = data.words[row[4 + k]];
        if (value === "") { return; }
        var line = document.createElement("div");
        line.append(span(label + " ", false), span(value, true));
        tip.appendChild(line);
      });
      tip.style.left = tip.style.top = "0";  // where it is as wide as it can be, to be measured
      var x = (row[0] + Math.min(row[2], size.width / 2)) * scale, y = row[1] * scale;
      var left = Math.max(0, Math.min(x + 10, drawing.clientWidth - tip.offsetWidth));
      var top = y - tip.offsetHeight - 10;
      tip.style.left = left + "px";
      tip.style.top = (top < -40 ? (row[1] + row[3]) * scale + 12 : top) + "px";
    }

    function nearest(event) {
      var frame = svg.getBoundingClientRect(), scale = frame.width / size.width;
      var x = (event.clientX - frame.left) / scale, y = (event.clientY - frame.top) / scale;
      var best = -1, least = (event.pointerType === "touch" ? 28 : 16) / scale;
      rows.forEach(function (row, k) {
        var dx = Math.max(row[0] - x, 0, x - row[0] - row[2]), dy = Math.max(row[1] - y, 0, y - row[1] - row[3]);
        var away = Math.hypot(dx, dy) + 0.001 * Math.hypot(row[2], row[3]);
        if (away < least) { least = away; best = k; }
      });
      return best;
    }

    function follow(event) {
      var index = nearest(event);
      if (index < 0) { hide(); } else { show(index); }
    }

    function step(event) {
      var at = order.indexOf(shown), last = order.length - 1, next;
      switch (event.key) {
        case "ArrowRight": case "ArrowDown": next = Math.min(at + 1, last); break;
        case "ArrowLeft": case "ArrowUp": next = at < 0 ? last : Math.max(at - 1, 0); break;
        case "Home": next = 0; break;
        case "End": next = last; break;
        case "Escape": hide(); return;
        default: return;
      }
      event.preventDefault();
      show(order[next]);
    }

    if (rows.length > MANY) { svg.style.willChange = "transform"; }  // painted once, on a layer of its own
    drawing.tabIndex = 0;
    drawing.setAttribute("role", "group");
    drawing.setAttribute("aria-label", (svg.querySelector("title") || svg).textContent + ": arrow keys go through its " + rows.length + " points");
    drawing.addEventListener("pointermove", follow);
    drawing.addEventListener("pointerdown", follow);
    // A finger leaves as it lifts, which is when one looks: what it showed stays until another touch.
    drawing.addEventListener("pointerleave", function (event) { if (event.pointerType !== "touch") { hide(); } });
    document.addEventListener("pointerdown", function (event) { if (!drawing.contains(event.target)) { hide(); } });
    drawing.addEventListener("keydown", step);
    drawing.addEventListener("blur", hide);
  }

  document.querySelectorAll(".drawing[data-points]").forEach(tips);

  // To take away: figures as SVG and PNG, tables as CSV, made here from what the page holds.
  // Files are called after what the page is about and the name that --output svg:FOLDER gives a figure.
  function fileName(text) {
    var words = text.toLowerCase().match(/[\p{L}\p{M}\p{N}]+/gu) || [], name = "";
    words.every(function (word) {
      var longer = name ? name + "-" + word : word;
      if (name && longer.length > 60) { return false; }
      name = longer.slice(0, 60);
      return true;
    });
    return name;
  }

  function called(part, kind) {
    var about = fileName(document.querySelector("h1").textContent) || "report";
    return (part ? about + "-" + part : about) + "." + kind;
  }

  function save(blob, name) {
    var link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    window.setTimeout(function () { URL.revokeObjectURL(link.href); }, 1000);
  }

  // A copy that stands alone: colours of the theme that is shown, sizes and a ground of its own.
  function alone(svg) {
    var copy = svg.cloneNode(true), theme = getComputedStyle(document.documentElement), box = svg.viewBox.baseVal;
    copy.querySelectorAll("[style]").forEach(function (part) {
      part.setAttribute("style", part.getAttribute("style")
        .replace(/calc\((\d+(?:\.\d+)?px)[^)]*\)\)/g, "$1")
        .replace(/var\((--[a-z0-9-]+)\)/g, function (_, name) { return theme.getPropertyValue(name).trim(); }));
    });
    var ground = document.createElementNS(SVG, "rect");
    [["width", box.width], ["height", box.height], ["fill", theme.getPropertyValue("--surface").trim()]].forEach(function (pair) {
      ground.setAttribute(pair[0], pair[1]);
    });
    copy.insertBefore(ground, copy.querySelector("g"));
    copy.setAttribute("width", box.width);
    copy.setAttribute("height", box.height);
    return new XMLSerializer().serializeToString(copy);
  }

  function picture(svg, done) {
    var box = svg.viewBox.baseVal, image = new Image(), scale = 3;
    image.onload = function () {
      var canvas = document.createElement("canvas");
      canvas.width = Math.round(box.width * scale);
      canvas.height = Math.round(box.height * scale);
      canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
      canvas.toBlob(done, "image/png");
    };
    image.src = "data:image/svg+xml;charset=utf-8," + encodeURIComponent(alone(svg));
  }

  // What a cell says as a spreadsheet reads it: no symbol before the words, figures without gaps, a plain minus.
  function field(cell) {
    var copy = (cell.querySelector(".cell") || cell).cloneNode(true), mark = copy.querySelector(".mark");
    if (mark && copy.textContent.trim() !== mark.textContent.trim()) { mark.remove(); }
    copy.querySelectorAll(".sub").forEach(function (sub) { sub.prepend(" ("); sub.append(")"); });
    return quoted(copy.textContent);
  }

  function quoted(words) {
    var text = words.replace(/(\d)\u00a0(?=\d{3}(?!\d))/g, "$1").replace(/\u2212/g, "-").replace(/[\u00a0\s]+/g, " ").trim();
    if (/^[=+@\t-]/.test(text) && isNaN(Number(text.split(" ")[0]))) { text = "'" + text; }
    return /[",\n]/.test(text) ? '"' + text.replace(/"/g, '""') + '"' : text;
  }

  function csv(rows) {
    return rows.map(function (row) { return row.join(","); }).join("\r\n") + "\r\n";
  }

  function shown(table) {
    return Array.prototype.map.call(table.rows, function (row) { return Array.prototype.map.call(row.cells, field); });
  }

  // Of the values of a figure the table shows the first and the last; the file holds them all.
  function every(frame, table) {
    var figure = frame.matches(".inner") && frame.closest("figure");
    var data = figure && said.get(figure.querySelector(".drawing"));
    if (!data) { return shown(table); }
    var once = {};  // what stands in two panels is one value
    data.rows.forEach(function (row) { var says = row.slice(4).join(" "); once[says] = once[says] || row; });
    var rows = data.rows.filter(function (row) { return once[row.slice(4).join(" ")] === row; });
    if (rows.length < table.rows.length) { return shown(table); }
    return [data.labels.map(quoted)].concat(rows.map(function (row) {
      return data.labels.map(function (_, k) { return quoted(data.words[row[4 + k]]); });
    }));
  }

  function offer(choices) {
    var row = document.createElement("p");
    row.className = "take";
    choices.forEach(function (choice) {
      var button = document.createElement("button");
      button.type = "button";
      button.textContent = choice[0];
      button.setAttribute("aria-label", "Save " + choice[1] + " as " + choice[0]);
      button.addEventListener("click", choice[2]);
      row.appendChild(button);
    });
    return row;
  }

  document.querySelectorAll("figure").forEach(function (figure) {
    var svg = figure.querySelector("svg"), name = figure.dataset.name;
    var title = svg.querySelector("title").textContent;
    figure.querySelector(".beneath").prepend(offer([
      ["SVG", title, function () { save(new Blob([alone(svg)], { type: "image/svg+xml" }), called(name, "svg")); }],
      ["PNG", title, function () { picture(svg, function (blob) { save(blob, called(name, "png")); }); }]
    ]));
  });
  frames.forEach(function (frame) {
    var table = frame.querySelector("table"), title = frame.getAttribute("aria-label");
    var row = offer([["CSV", title, function () {
      var figure = frame.closest("figure"), name = figure ? figure.dataset.name : fileName(title);
      save(new Blob([csv(every(frame, table))], { type: "text/csv" }), called(name, "csv"));
    }]]), before = frame.previousElementSibling;
    var over = before && /^H[23]$/.test(before.tagName) && table.querySelector("caption .unseen");
    row.classList.toggle("over", Boolean(over));
    if (frame.parentElement.matches(".pair, .trio, .split")) {
      var both = document.createElement("div");
      frame.replaceWith(both);
      both.append(frame);
    }
    frame.insertAdjacentElement(over ? "beforebegin" : "afterend", row);
  });

  // Sliders: tau and the limit move the operating point and recolour the verdict.
  var form = document.getElementById("explorer");
  if (!form) { return; }
  var data = form.dataset;
  var floor = parseFloat(data.floor), rate = parseFloat(data.rate), tau0 = parseFloat(data.tau);
  var crit = data.crit === "" ? Infinity : parseFloat(data.crit);
  var limit0 = data.limit === "" ? null : parseFloat(data.limit);
  var limitSize = parseFloat(data.limitSize);
  var syncLimit = parseFloat(data.syncLimit), othersPass = data.others === "1";
  var box = data.box.split(" ").map(parseFloat);
  var tauSlider = document.getElementById("tau-slider");
  var limitSlider = document.getElementById("limit-slider");
  var banner = document.getElementById("banner");
  var bannerTone = banner.className;
  var whatIf = document.getElementById("what-if");

  function element(suffix) { return document.getElementById(data.figure + "-" + suffix); }

  function clamp(value, low, high) { return Math.min(high, Math.max(low, value)); }

  function across(tau) {
    var share = (-Math.log10(tau) - box[4]) / (box[5] - box[4]);
    return clamp(box[0] + share * (box[1] - box[0]), box[0], box[1]);
  }

  function share(error) { return (-Math.log10(error) - box[6]) / (box[7] - box[6]); }

  function down(error) {
    return clamp(box[3] - share(error) * (box[3] - box[2]), box[2], box[3]);
  }

  // A limit beyond the frame is drawn at its edge.
  function beyond(limit) { return share(limit) > 1 ? " \u2191" : share(limit) < 0 ? " \u2193" : ""; }

  function quantity(value, units) {
    for (var i = units.length - 1; i > 0; i -= 1) {
      if (value >= 0.9995 * units[i][0]) { break; }
    }
    var figure = Number((value / units[i][0]).toPrecision(4));
    return figure + "\u00a0" + units[i][1];
  }

  function time(value) {
    return quantity(value, [[1e-12, "ps"], [1e-9, "ns"], [1e-6, "\u00b5s"], [1e-3, "ms"], [1, "s"]]);
  }

  function length(value) {
    return quantity(value, [[1e-9, "nm"], [1e-6, "\u00b5m"], [1e-3, "mm"], [1, "m"], [1e3, "km"]]);
  }

  // In the unit of the limit, where the spec writes one and the figure is readable in it.
  function besideLimit(value) {
    var amount = value / limitSize;
    return amount >= 1e-4 && amount < 1e5 ? quantity(value, [[limitSize, data.limitUnit]]) : length(value);
  }

  // The sliders run over logarithms; without a script they never show.
  function toLog(slider) {
    ["min", "max", "value"].map(function (name) {
      return [name, Math.log10(parseFloat(slider.getAttribute(name)))];
    }).forEach(function (pair) { slider.setAttribute(pair[0], String(pair[1])); });
    slider.step = "any";
    slider.value = slider.getAttribute("value");
  }

  function shift(group, dx, dy) {
    if (group) { group.setAttribute("transform", "translate(" + dx.toFixed(2) + " " + dy.toFixed(2) + ")"); }
  }

  function paint(group, met) {
    if (!group) { return; }
    group.querySelectorAll("use, path").forEach(function (shape) {
      shape.style.fill = met ? "var(--good)" : "var(--bad)";
    });
  }

  function moved() {
    return Math.abs(parseFloat(tauSlider.value) - Math.log10(tau0)) > 1e-9 ||
      (limit0 !== null && Math.abs(parseFloat(limitSlider.value) - Math.log10(limit0)) > 1e-9);
  }

  function update() {
    var changed = moved();
    var tau = changed ? Math.pow(10, parseFloat(tauSlider.value)) : tau0;
    var limit = limit0 === null ? null : changed ? Math.pow(10, parseFloat(limitSlider.value)) : limit0;
    var error = floor + rate * tau;
    var accurate = limit === null || error <= limit * (1 + 1e-12);
    var synchronous = tau < syncLimit * crit;
    var met = accurate && synchronous && othersPass;
    var point = element("operating-point");
    shift(point, across(tau) - across(tau0), down(error) - down(floor + rate * tau0));
    paint(point, accurate);
    if (limit !== null) {
      shift(element("limit-line"), 0, down(limit) - down(limit0));
      var label = element("limit-label");
      shift(label, 0, down(limit) - down(limit0));
      var text = label ? label.querySelector("text") : null;
      var said = changed ? besideLimit(limit) : data.limitShown;
      if (text) { text.textContent = "limit " + said + beyond(limit); }
      document.getElementById("limit-value").textContent = said;
      limitSlider.setAttribute("aria-valuetext", said);
    }
    document.getElementById("tau-value").textContent = time(tau);
    tauSlider.setAttribute("aria-valuetext", time(tau));
    tell(changed, met, accurate, synchronous, error, tau);
  }

  function tell(changed, met, accurate, synchronous, error, tau) {
    var reasons = [];
    if (!accurate) { reasons.push("the error exceeds the limit"); }
    if (!synchronous) { reasons.push("\u03c4 is not below \u03c4_crit"); }
    if (!othersPass) { reasons.push("another requirement fails"); }
    var word = met ? "\u2713 would meet" : "\u2717 would not meet: " + reasons.join("; ");
    var output = document.getElementById("explorer-verdict");
    output.textContent = "Error " + besideLimit(error) + " \u2014 " + word;
    output.className = met ? "good" : "bad";
    whatIf.hidden = !changed;
    whatIf.textContent = changed ? "What if \u03c4 were " + time(tau) + ": " + word : "";
    banner.className = changed ? "banner what-if-" + (met ? "good" : "bad") : bannerTone;
  }

  function reset() {
    tauSlider.value = String(Math.log10(tau0));
    if (limit0 !== null) { limitSlider.value = String(Math.log10(limit0)); }
    update();
  }

  toLog(tauSlider);
  tauSlider.addEventListener("input", update);
  if (limitSlider) {
    toLog(limitSlider);
    limitSlider.addEventListener("input", update);
  }
  document.getElementById("explorer-reset").addEventListener("click", reset);
  form.addEventListener("submit", function (event) { event.preventDefault(); });
  form.hidden = false;
  reset();
}());
