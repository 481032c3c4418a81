#!/usr/bin/env python3
"""Opens a report in a real headless Chromium and checks it. Usage: check_report.py REPORT.html SCREENSHOTS_FOLDER

    apt-get install chromium; pip install websocket-client

Fails on any console message, network request, missing section, empty figure, sideways scrolling, or a control that the keyboard
does not reach. Leaves screenshots: wide and narrow, light and dark.
"""

import base64
import itertools
import pathlib
import sys
import time

from browser import Browser

page = pathlib.Path(sys.argv[1]).resolve()
folder = pathlib.Path(sys.argv[2])
folder.mkdir(parents=True, exist_ok=True)
# Sections and fewest figures of a report on classifiers, and of one on a study.
CLASSIFIERS = (["results", "accuracy", "comparisons", "audit", "contenders", "published", "groups", "ranks", "glossary"], 4)
STUDY = (["results", "curves", "tasks", "glossary"], 1)


browser = Browser()
wrong = []
try:
    for domain in ("Page", "Runtime", "Log", "Network"):
        browser.call(f"{domain}.enable")
    for width, scheme in itertools.product((1280, 390), ("light", "dark")):
        browser.call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=width < 600)
        browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        browser.call("Page.navigate", url=page.as_uri())
        for _ in range(200):
            if browser.run("document.readyState") == "complete":
                break
            time.sleep(0.05)
        if browser.run("document.documentElement.scrollWidth > window.innerWidth + 1"):
            wrong.append(f"{width} px: the page scrolls sideways")
        shot = browser.call("Page.captureScreenshot", captureBeyondViewport=True,
                            clip={"x": 0, "y": 0, "width": width, "height": 6000, "scale": 1})
        (folder / f"report_{width}_{scheme}.png").write_bytes(base64.b64decode(shot["data"]))
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
        wrong.append(f"{figures} figures, of which without picture or caption: {empty}")
    # Sorting by keyboard: focus a header's button, press Enter.
    browser.run("document.querySelector('section[aria-labelledby=results] th button').focus()")
    browser.press("Enter", 13, "\r")
    order = browser.run("document.querySelector('section[aria-labelledby=results] :is(th[aria-sort=ascending], th[aria-sort=descending])') !== null")
    if not order:
        wrong.append("Enter on a column's button does not sort")
    # Everything that can be clicked can be focused.
    unreachable = browser.run(
        "[...document.querySelectorAll('a[href], button, summary, [tabindex]:not(main)')].filter(e => e.tabIndex < 0).length"
    )
    if unreachable:
        wrong.append(f"{unreachable} controls are out of the keyboard's reach")
    # The confusion matrix speaks when it is walked through with the arrow keys.
    said = "predicted"
    if not is_study:
        browser.run("document.querySelector('.matrix').focus()")
        browser.press("ArrowRight", 39)
        browser.press("ArrowDown", 40)
        said = browser.run("document.querySelector('.tip')?.textContent ?? ''")
    if "predicted" not in said:
        wrong.append(f"the confusion matrix says `{said}` under the arrow keys")
    for event in browser.events:
        method, detail = event.get("method"), event.get("params", {})
        if method in ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded"):
            wrong.append(f"console: {json.dumps(detail)[:300]}")
        if method == "Network.requestWillBeSent":
            url = detail["request"]["url"]
            if url != page.as_uri() and not url.startswith("data:"):
                wrong.append(f"the page asks for {url}")
finally:
    browser.close()
for line in wrong:
    print(line, file=sys.stderr)
print(f"{figures} figures, {len(sections)} sections, screenshots in {folder}: {'wrong' if wrong else 'fine'}")
sys.exit(bool(wrong))
