"""How soon the live page is seen in Chromium."""

import re
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service

from sain_bringup.graph import executable
from sain_bringup.graph_options import LiveOptions

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--no-first-run",
    "--disable-background-networking", "--window-size=1366,768",
)  # fmt: skip
ADDRESS = re.compile(r"the page is at (\S+)")
PATIENCE = 120.0  # [s]
SEEN = """
const texts = document.body ? document.body.innerText : "";
const done = arguments[0];
if (!texts.includes("to the goal") || !document.querySelector("canvas")) { done(false); return; }
requestAnimationFrame(() => requestAnimationFrame(() => done(true)));
"""


def seconds_to_picture(live: LiveOptions) -> float:
    """Return the time [s] from the start of the command to the scene in a browser."""
    with tempfile.TemporaryDirectory() as folder:
        chrome = opened()
        chrome.set_script_timeout(PATIENCE)
        said = Path(folder, "said.txt")
        options = ["--port", str(live.port), "--no-record", "--scenario", live.scenario]
        command = [str(executable("sain_bringup", "live")), *options]
        begun = time.monotonic()
        with said.open("w") as stream:
            process = subprocess.Popen(command, stdout=stream, stderr=stream, cwd=folder)
        try:
            while not (found := ADDRESS.search(said.read_text())):
                assert time.monotonic() - begun < PATIENCE, said.read_text()
                time.sleep(0.02)
            chrome.get(found[1])
            while not chrome.execute_async_script(SEEN):
                assert time.monotonic() - begun < PATIENCE, "no picture"
                time.sleep(0.02)
            return time.monotonic() - begun
        finally:
            process.send_signal(signal.SIGINT)
            process.wait()
            chrome.quit()


def opened() -> webdriver.Chrome:
    """Return a browser that draws on the processor."""
    options = Options()
    options.binary_location = next(filter(None, map(shutil.which, BROWSERS)))
    for flag in FLAGS:
        options.add_argument(flag)
    return webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
