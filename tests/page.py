"""Shared parts of the checks of the live page: sizes, screenshots, and a check for content that is cut off."""

import base64
import time

SIZES = {"laptop": (1280, 800), "phone": (390, 844)}
# Elements that extend beyond the window horizontally or beyond their card.
CUT_OFF = """[...document.querySelectorAll('section:not([hidden]) *, header *')].filter(e => {
  if (e.closest('.spoken') || !e.getClientRects().length) return false;
  const r = e.getBoundingClientRect(), card = e.closest('section'), box = card && card.getBoundingClientRect();
  if (r.right > innerWidth + 1 || r.left < -1) return true;
  return box && !e.closest('#events') && !e.closest('svg') && (r.bottom > box.bottom + 1 || r.right > box.right + 1);
}).map(e => e.id || e.className || e.tagName).join(' ')"""


def wait_for(browser, script, seconds, what, wrong):
    """Waits until the script returns true; adds `what` to `wrong` if it does not in time."""
    for _ in range(int(10 * seconds)):
        if browser.run(script):
            return True
        time.sleep(0.1)
    wrong.append(f"failed: {what}")
    return False


def show_at(browser, size, scheme):
    width, height = SIZES[size]
    browser.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=size == "phone")
    browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
    time.sleep(0.3)


def check_frame(browser, where, wrong):
    """Adds content that is cut off or scrolls horizontally to `wrong`; on a laptop also a page that is higher than its window."""
    if not browser.run("document.documentElement.scrollWidth <= innerWidth"):
        wrong.append(f"{where}: the page scrolls horizontally")
    if cut := browser.run(CUT_OFF):
        wrong.append(f"{where}: cut off: {cut}")
    if where.startswith("laptop") and not browser.run("document.documentElement.scrollHeight <= innerHeight"):
        wrong.append(f"{where}: higher than the window")


def shoot(browser, folder, name):
    shot = browser.call("Page.captureScreenshot", captureBeyondViewport=True, format="png")
    (folder / f"{name}.png").write_bytes(base64.b64decode(shot["data"]))
