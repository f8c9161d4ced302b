"""A headless Chromium that opens a page and tells what it sees."""

import json
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-dev-shm-usage", "--hide-scrollbars",
)  # fmt: skip

WEBGL = (  # on the processor
    *(flag for flag in FLAGS if flag != "--disable-gpu"),
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip


@contextmanager
def opened_browser(flags: Sequence[str] = FLAGS) -> Iterator["Browser"]:
    """Start a browser with a profile of its own, and end it."""
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    driver = shutil.which("chromedriver")
    if not program or not driver:
        pytest.fail("pages are tested in Chromium: sudo apt install chromium chromium-driver")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        options = Options()
        options.binary_location = program
        for flag in (*flags, f"--user-data-dir={profile}"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        chrome = webdriver.Chrome(options=options, service=Service(driver))
        try:
            yield Browser(chrome)
        finally:
            chrome.quit()


class Browser:
    """What a test asks of a page."""

    def __init__(self, chrome: webdriver.Chrome) -> None:
        self.chrome = chrome

    def open(self, page: Path | str, width: int = 1400, scheme: str = "light") -> None:
        """Load a page anew, by its file or its address."""
        self._logs("performance"), self._logs("browser")
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        feature = {"name": "prefers-color-scheme", "value": scheme}
        self.chrome.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        self.chrome.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
        self.chrome.get(page if isinstance(page, str) else page.resolve().as_uri())
        self.settle()

    def settle(self) -> None:
        """Wait until charts are drawn: when their width is known, which is a frame later."""
        wait = "requestAnimationFrame(() => requestAnimationFrame(arguments[0]))"
        self.chrome.execute_async_script(wait)

    def complaints(self) -> list[str]:
        """Return what the console said since the page was opened."""
        return [entry["message"] for entry in self._logs("browser")]

    def requests(self) -> list[str]:
        """Return what the page asked for since it was opened, itself aside."""
        url, found = self.chrome.current_url, []
        for entry in self._logs("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                parameters = message["params"]
                asked = parameters["request"]["url"]
                if parameters["documentURL"] == url and asked not in (url, "data:,"):
                    found.append(asked)
        return found

    def run(self, script: str, *arguments: Any) -> Any:
        return self.chrome.execute_script(script, *arguments)

    def all(self, selector: str) -> list[WebElement]:
        return self.chrome.find_elements(By.CSS_SELECTOR, selector)

    def one(self, selector: str) -> WebElement:
        return self.chrome.find_element(By.CSS_SELECTOR, selector)

    def text(self, selector: str) -> str:
        return self.one(selector).text

    def numbers(self, selector: str, attribute: str) -> list[float]:
        """Return an attribute of every such element as a number."""
        return [float(element.get_attribute(attribute)) for element in self.all(selector)]

    def disks(self) -> list[list[float]]:
        """Return where the disks are drawn: x, y [m] and theta [rad], y and angles up."""
        return self.run(
            """const view = document.getElementById("view").getScreenCTM().inverse();
            return [...document.querySelectorAll("#view .disks g")].map((disk) => {
              const m = view.multiply(disk.getScreenCTM());
              return [m.e / 1000, -m.f / 1000, -Math.atan2(m.b, m.a)];
            });"""
        )

    def _logs(self, kind: str) -> list[dict[str, Any]]:
        return self.chrome.get_log(kind)
