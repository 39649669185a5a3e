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

  // Sliders: tau and the target move the operating point and recolour the verdict.
  var form = document.getElementById("explorer");
  if (!form) { return; }
  var data = form.dataset;
  var floor = parseFloat(data.floor), rate = parseFloat(data.rate), tau0 = parseFloat(data.tau);
  var crit = data.crit === "" ? Infinity : parseFloat(data.crit);
  var target0 = data.target === "" ? null : parseFloat(data.target);
  var syncLimit = parseFloat(data.syncLimit), othersPass = data.others === "1";
  var box = data.box.split(" ").map(parseFloat);
  var tauSlider = document.getElementById("tau-slider");
  var targetSlider = document.getElementById("target-slider");
  var banner = document.getElementById("banner");
  var bannerTone = banner.className;
  var whatIf = document.getElementById("what-if");

  function element(suffix) { return document.getElementById(data.figure + "-" + suffix); }

  function clamp(value, low, high) { return Math.min(high, Math.max(low, value)); }

  function across(tau) {
    var share = (-Math.log10(tau) - box[4]) / (box[5] - box[4]);
    return clamp(box[0] + share * (box[1] - box[0]), box[0], box[1]);
  }

  function down(error) {
    var share = (-Math.log10(error) - box[6]) / (box[7] - box[6]);
    return clamp(box[3] - share * (box[3] - box[2]), box[2], box[3]);
  }

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
      (target0 !== null && Math.abs(parseFloat(targetSlider.value) - Math.log10(target0)) > 1e-9);
  }

  function update() {
    var changed = moved();
    var tau = changed ? Math.pow(10, parseFloat(tauSlider.value)) : tau0;
    var target = target0 === null ? null : changed ? Math.pow(10, parseFloat(targetSlider.value)) : target0;
    var error = floor + rate * tau;
    var accurate = target === null || error <= target * (1 + 1e-12);
    var synchronous = tau < syncLimit * crit;
    var met = accurate && synchronous && othersPass;
    var point = element("operating-point");
    shift(point, across(tau) - across(tau0), down(error) - down(floor + rate * tau0));
    paint(point, accurate);
    if (target !== null) {
      shift(element("target-line"), 0, down(target) - down(target0));
      var label = element("target-label");
      shift(label, 0, down(target) - down(target0));
      var text = label ? label.querySelector("text") : null;
      if (text) { text.textContent = "target " + length(target); }
      document.getElementById("target-value").textContent = length(target);
      targetSlider.setAttribute("aria-valuetext", length(target));
    }
    document.getElementById("tau-value").textContent = time(tau);
    tauSlider.setAttribute("aria-valuetext", time(tau));
    tell(changed, met, accurate, synchronous, error, tau);
  }

  function tell(changed, met, accurate, synchronous, error, tau) {
    var reasons = [];
    if (!accurate) { reasons.push("the error exceeds the target"); }
    if (!synchronous) { reasons.push("\u03c4 is not below \u03c4_crit"); }
    if (!othersPass) { reasons.push("another requirement fails"); }
    var word = met ? "\u2713 would meet" : "\u2717 would not meet: " + reasons.join("; ");
    var output = document.getElementById("explorer-verdict");
    output.textContent = "Error " + length(error) + " \u2014 " + word;
    output.className = met ? "good" : "bad";
    whatIf.hidden = !changed;
    whatIf.textContent = changed ? "What if \u03c4 were " + time(tau) + ": " + word : "";
    banner.className = changed ? "banner what-if-" + (met ? "good" : "bad") : bannerTone;
  }

  function reset() {
    tauSlider.value = String(Math.log10(tau0));
    if (target0 !== null) { targetSlider.value = String(Math.log10(target0)); }
    update();
  }

  toLog(tauSlider);
  tauSlider.addEventListener("input", update);
  if (targetSlider) {
    toLog(targetSlider);
    targetSlider.addEventListener("input", update);
  }
  document.getElementById("explorer-reset").addEventListener("click", reset);
  form.addEventListener("submit", function (event) { event.preventDefault(); });
  form.hidden = false;
  reset();
}());
