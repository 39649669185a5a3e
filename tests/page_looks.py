"""What makes a page hard to read, measured in a browser; and axe, in both themes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

AXE = Path(__file__).parent / "vendor" / "axe-core" / "axe.min.js"
WIDTHS = (420, 768, 1300)
FLAWS = """(width) => {
  const flaws = [], seen = e => e.checkVisibility();
  if (document.documentElement.scrollWidth > width) flaws.push('the page is wider than the window');
  document.querySelectorAll('.scroll, .inner').forEach(frame => {
    if (!seen(frame)) return;
    [['::before', frame.scrollWidth > frame.clientWidth + 1],
     ['::after', frame.scrollHeight > frame.clientHeight + 1]].forEach(([place, cut]) => {
      const hint = getComputedStyle(frame, place).content;
      if (cut && !hint.includes('scroll')) flaws.push('cut without a hint: ' + frame.ariaLabel);
    });
    frame.querySelectorAll('td, th').forEach(cell => {
      const box = cell.getBoundingClientRect();
      if (box.width < 90 && box.height > 190) flaws.push('squeezed: ' + cell.innerText);
    });
  });
  const list = document.querySelector('nav ul');
  const mark = getComputedStyle(list.parentElement, '::after').content;
  if (list.scrollWidth > list.clientWidth + 1 && mark === 'none')
    flaws.push('sections cut without a hint');
  document.querySelectorAll('section tbody th, section p, section dd, section td').forEach(e => {
    if (!seen(e)) return;
    e.querySelectorAll('.whole').forEach(word => {
      if (word.getClientRects().length > 1) flaws.push('broken: ' + word.innerText);
    });
  });
  document.querySelectorAll('thead button').forEach(button => {
    const unseen = getComputedStyle(button.closest('thead')).position === 'absolute';
    if (seen(button) && unseen && button.tabIndex >= 0)
      flaws.push('a stop of the Tab key that nobody sees: ' + button.innerText);
  });
  document.querySelectorAll('h3').forEach(head => {
    const next = head.nextElementSibling;
    if (seen(head) && !(next && (next.innerText.trim() || next.querySelector('svg'))))
      flaws.push('nothing below ' + head.innerText);
  });
  if (width > 1000) document.querySelectorAll('.alone > figure').forEach(figure => {
    const frame = figure.querySelector('.beneath .inner');
    if (!frame || !seen(frame)) return;
    const foot = e => figure.querySelector(e).getBoundingClientRect().bottom;
    const over = foot('.beneath') - foot('.drawing'), name = frame.ariaLabel;
    const cut = frame.scrollHeight > frame.clientHeight + 1;
    if (cut && over < -40) flaws.push(`cut ${-over} px above the foot of its figure: ${name}`);
    const most = frame.matches('.few') ? 250 : 80;
    if (over > most) flaws.push(`${over} px longer than its figure: ${name}`);
  });
  document.querySelectorAll('figure svg').forEach(svg => {
    if (!seen(svg)) return;
    const name = svg.querySelector('title').textContent, frame = svg.getBoundingClientRect();
    if (width > 1000) {
      const part = svg.closest('section').getBoundingClientRect();
      const beside = svg.closest('.pair, .flow, .trio, .split, .alone');
      if (!beside && frame.width < 0.7 * part.width) flaws.push('half blank: ' + name);
    }
    const boxes = [...svg.querySelectorAll('text')].filter(t => t.textContent.trim()).map(t => {
      const m = t.getScreenCTM(), b = t.getBoundingClientRect();
      const size = Math.hypot(m.a, m.b) * parseFloat(getComputedStyle(t).fontSize);
      if (width < 500 && size < 11) flaws.push(`${size.toFixed(1)} px in ${name}`);
      const out = b.left < frame.left - 1 || b.right > frame.right + 1 ||
        b.top < frame.top - 1 || b.bottom > frame.bottom + 1;
      if (out) flaws.push(`${t.textContent} sticks out of ${name}`);
      return [b, t.textContent];
    });
    boxes.forEach(([a, one], i) => boxes.slice(i + 1).forEach(([b, other]) => {
      const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      const down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (across > 1.5 && down > 0.3 * Math.min(a.height, b.height))
        flaws.push(`${one} lies on ${other} in ${name}`);
    }));
  });
  return flaws;
}"""
COLOURS = {"runOnly": ["color-contrast"]}
BARRIERS = """async (options) => {
  const found = await axe.run(document, {...options, resultTypes: ['violations']});
  const places = one => one.nodes.slice(0, 3).map(node => node.html.slice(0, 120));
  return {passes: found.passes.length,
          violations: found.violations.map(one => [one.id, places(one)])};
}"""


def flaws(page: Any) -> list[str]:
    """Flaws at every width, each with its width."""
    found = []
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        page.evaluate("() => new Promise(done => requestAnimationFrame(() => setTimeout(done)))")
        found += [f"{width}: {flaw}" for flaw in page.evaluate(FLAWS, width)]
    return found


def barriers(page: Any) -> list[tuple[str, str, list[str]]]:
    """What axe finds in the light theme at the width that there is; in the dark one, of colours.

    Nothing but colours differs between the themes.  What holds is only counted: the places where
    each rule holds, and carrying them out of the browser, would cost more than looking.
    """
    page.evaluate(AXE.read_text(encoding="utf-8") + "; undefined")
    found = []
    for theme, options, least in (("light", {}, 15), ("dark", COLOURS, 0)):
        page.emulate_media(color_scheme=theme)
        result = page.evaluate(BARRIERS, options)
        assert result["passes"] > least
        found += [(theme, rule, places) for rule, places in result["violations"]]
    return found
