#!/usr/bin/env python3
"""Opens a report in a headless Chromium and checks it. Usage: check_report.py REPORT.html SCREENSHOTS_FOLDER

    apt-get install chromium; pip install websocket-client

Fails on console messages, network requests, missing sections, empty figures, horizontal scrolling of the page, and controls that the keyboard
cannot reach. Fails unless the headline is the first text after the title, a phone shows model and accuracy side by side, scrollable frames have a
label, and the provenance is folded. Checks the contrast of texts, also in dark mode and in print. Writes screenshots.
"""

import base64
import itertools
import json
import pathlib
import sys
import time

from browser import Browser

page = pathlib.Path(sys.argv[1]).resolve()
folder = pathlib.Path(sys.argv[2])
folder.mkdir(parents=True, exist_ok=True)
# Required sections and minimum number of figures: of a report on classifiers, and of one on a study.
CLASSIFIERS = (["results", "accuracy", "contenders", "provenance", "glossary"], 4)
STUDY = (["results", "curves", "provenance", "glossary"], 1)
# The headline is the first text after the title; it contains a number and a qualifying sentence.
HEADLINE = """(() => {
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  texts.currentNode = document.querySelector('h1');
  for (let node; (node = texts.nextNode());) {
    if (!node.textContent.trim() || node.parentElement.closest('h1')) continue;
    const headline = node.parentElement.closest('.headline');
    return !!headline && /[0-9]/.test(headline.querySelector('.lead strong')?.textContent ?? '')
      && headline.querySelector('.qualifier').textContent.trim().endsWith('.');
  }
})()"""
# In the table of results: true if all row names and scores are fully visible, and their right edge.
IN_VIEW = """(() => {
  const table = document.querySelector('table.results');
  const score = table.querySelector('thead .score').cellIndex;
  const rows = [...table.rows].filter((row) => !row.classList.contains('separator'));
  const ends = rows.flatMap((row) => [row.cells[0], row.cells[score]]).map((cell) => cell.getBoundingClientRect());
  const apart = rows.every((row) => row.cells[0].getBoundingClientRect().right <= row.cells[score].getBoundingClientRect().left + 1);
  return {rows: rows.length, left: Math.min(...ends.map((e) => e.left)), right: Math.max(...ends.map((e) => e.right)), apart};
})()"""
# Scrollable frames without a label.
SILENT = """[...document.querySelectorAll('.scroll')].filter((frame) => frame.checkVisibility()
  && frame.scrollWidth > frame.clientWidth + 1 && (frame.previousElementSibling?.className !== 'hint' || frame.previousElementSibling.hidden))
  .map((frame) => frame.getAttribute('aria-label'))"""
# Axis titles in figures that overlap other text.
RUN_INTO = """[...document.querySelectorAll('svg.figure')].filter((svg) => svg.checkVisibility()).flatMap((svg) => {
  const texts = [...svg.querySelectorAll('text')].map((text) => [text, text.getBoundingClientRect()]);
  return texts.filter(([text]) => text.classList.contains('label')).flatMap(([title, a]) => texts
    .filter(([text, b]) => text !== title && a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom)
    .map(([text]) => title.textContent + ' / ' + text.textContent));
})"""
# Number of open details in the provenance, and true if it follows the results.
UNFOLDED = "document.querySelectorAll('section[aria-labelledby=provenance] details[open]').length"
FOLDED_FACTS = "[...document.querySelectorAll('dl.facts')].every((facts) => facts.closest('section[aria-labelledby=provenance] details'))"
# The lowest contrast of a text with its background (WCAG: at least 4.5).
CONTRAST = """(() => {
  const parts = (colour) => colour.match(/[0-9.]+/g).map(Number);
  const light = (colour) => parts(colour).slice(0, 3).map((v) => v / 255)
    .map((v) => (v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)).reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
  const ground = (element) => {
    for (let at = element; at; at = at.parentElement) {
      const colour = getComputedStyle(at).backgroundColor;
      if ((parts(colour)[3] ?? 1) > 0.5) return colour;
    }
    return 'rgb(255, 255, 255)';
  };
  let lowest = [99, ''];
  for (const element of document.querySelectorAll('h1, h2, p, th, td, li, dt, dd, summary, figcaption, a, svg text')) {
    if (!element.checkVisibility() || !element.textContent.trim()) continue;
    const style = getComputedStyle(element);
    const [a, b] = [light(element instanceof SVGElement ? style.fill : style.color), light(ground(element))].sort((x, y) => y - x);
    const contrast = (a + 0.05) / (b + 0.05);
    if (contrast < lowest[0]) lowest = [contrast, element.textContent.trim().slice(0, 40)];
  }
  return lowest;
})()"""


browser = Browser()
wrong = []
try:
    for domain in ("Page", "Runtime", "Log", "Network"):
        browser.call(f"{domain}.enable")
    for (width, height), scheme in itertools.product(((1280, 800), (390, 844)), ("light", "dark")):
        browser.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600)
        browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        browser.call("Page.navigate", url=page.as_uri())
        for _ in range(200):
            if browser.run("document.readyState") == "complete":
                break
            time.sleep(0.05)
        if browser.run("document.documentElement.scrollWidth > window.innerWidth + 1"):
            wrong.append(f"{width} px: the page scrolls sideways")
        if not browser.run(HEADLINE):
            wrong.append(f"{width} px: the first text after the title is not a headline with a number and a sentence")
        seen = browser.run(IN_VIEW)
        if seen["rows"] < 2 or seen["left"] < 0 or seen["right"] > width or not seen["apart"]:
            wrong.append(f"{width} px: names and scores of the results are not visible side by side: {seen}")
        # Resize observers run before the next frame is painted.
        browser.call("Runtime.evaluate", expression="new Promise((done) => requestAnimationFrame(() => setTimeout(done)))", awaitPromise=True)
        if silent := browser.run(SILENT):
            wrong.append(f"{width} px: scrolls without a label: {silent}")
        if browser.run(UNFOLDED) or not browser.run(FOLDED_FACTS):
            wrong.append(f"{width} px: provenance is not folded")
        if run_into := browser.run(RUN_INTO):
            wrong.append(f"{width} px: overlapping texts: {run_into[:3]}")
        contrast, text = browser.run(CONTRAST)
        if contrast < 4.5:
            wrong.append(f"{width} px, {scheme}: contrast {contrast:.1f} of `{text}`")
        shot = browser.call("Page.captureScreenshot", captureBeyondViewport=True,
                            clip={"x": 0, "y": 0, "width": width, "height": 6000, "scale": 1})
        (folder / f"report_{width}_{scheme}.png").write_bytes(base64.b64decode(shot["data"]))
    # Print: light, unfolded, nothing cut off.
    browser.call("Emulation.setDeviceMetricsOverride", width=720, height=1018, deviceScaleFactor=1, mobile=False)
    browser.call("Emulation.setEmulatedMedia", media="print", features=[{"name": "prefers-color-scheme", "value": "dark"}])
    browser.run("dispatchEvent(new Event('beforeprint'))")
    contrast, text = browser.run(CONTRAST)
    if contrast < 4.5:
        wrong.append(f"print: contrast {contrast:.1f} of `{text}`")
    if browser.run("document.querySelectorAll('details:not([open])').length"):
        wrong.append("print: folded parts stay folded")
    shot = browser.call("Page.captureScreenshot", captureBeyondViewport=True, clip={"x": 0, "y": 0, "width": 720, "height": 4000, "scale": 1})
    (folder / "report_print.png").write_bytes(base64.b64decode(shot["data"]))
    browser.run("dispatchEvent(new Event('afterprint'))")
    if browser.run(UNFOLDED):
        wrong.append("after printing, provenance stays unfolded")
    browser.call("Emulation.setEmulatedMedia", media="screen")
    is_study = browser.run("!!document.getElementById('curves')")
    sections, fewest = STUDY if is_study else CLASSIFIERS
    missing = [name for name in sections if not browser.run(f"!!document.getElementById('{name}')")]
    if missing:
        wrong.append(f"sections missing: {missing}")
    figures = browser.run("document.querySelectorAll('figure').length")
    empty = browser.run(
        "[...document.querySelectorAll('figure')].filter(f => !f.querySelector('figcaption') || ![...f.querySelectorAll('svg')]"
        ".some(s => s.querySelectorAll('rect, path, circle, line, polyline, text').length > 2)).map(f => f.textContent.slice(0, 60))"
    )
    if figures < fewest or empty:
        wrong.append(f"{figures} figures, without image or caption: {empty}")
    # Sort by keyboard: focus a header's button, press Enter.
    browser.run("document.querySelector('section[aria-labelledby=results] th button').focus()")
    browser.press("Enter", 13, "\r")
    order = browser.run("document.querySelector('section[aria-labelledby=results] th:first-child').getAttribute('aria-sort')")
    if order != "ascending":
        wrong.append("Enter on a column's button does not sort")
    # Every clickable element must be focusable.
    unreachable = browser.run(
        "[...document.querySelectorAll('a[href], button, summary, [tabindex]:not(main)')].filter(e => e.tabIndex < 0).length"
    )
    if unreachable:
        wrong.append(f"{unreachable} controls cannot be reached by keyboard")
    # The confusion matrix announces its cells on arrow keys.
    said = "predicted"
    if not is_study:
        browser.run("document.querySelector('.matrix').focus()")
        browser.press("ArrowRight", 39)
        browser.press("ArrowDown", 40)
        said = browser.run("document.querySelector('.tip')?.textContent ?? ''")
    if "predicted" not in said:
        wrong.append(f"on arrow keys the confusion matrix announces `{said}`")
    for event in browser.events:
        method, detail = event.get("method"), event.get("params", {})
        if method in ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded"):
            wrong.append(f"console: {json.dumps(detail)[:300]}")
        if method == "Network.requestWillBeSent":
            url = detail["request"]["url"]
            if url != page.as_uri() and not url.startswith("data:"):
                wrong.append(f"the page requests {url}")
finally:
    browser.close()
for line in wrong:
    print(line, file=sys.stderr)
print(f"{figures} figures, {len(sections)} sections, screenshots in {folder}: {'wrong' if wrong else 'fine'}")
sys.exit(bool(wrong))
