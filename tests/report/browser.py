"""A headless browser for tests of pages."""

import os

from selenium import webdriver
from selenium.webdriver.chrome.service import Service

DESKTOP, PHONE = (1440, 900), (390, 844)
# Seconds. A page is ready in 1 to 3 on an idle machine without a graphics card; this is for a busy one.
LONGEST_WAIT = 60


def start_browser():
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    # WebGL in software, so that the replay is drawn without a graphics card.
    for argument in ("--headless=new", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars",
                     "--disable-dev-shm-usage"):
        options.add_argument(argument)
    if os.geteuid() == 0:
        options.add_argument("--no-sandbox")  # which root cannot have
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
    # A script waits for the frame that is being drawn, which is long with a dozen programs beside; Selenium gives 30 s.
    browser.set_script_timeout(2 * LONGEST_WAIT)
    return browser
