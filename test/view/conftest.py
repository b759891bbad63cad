"""One headless browser for all tests of the page."""
import shutil

import pytest


@pytest.fixture(scope='session')
def browser(tmp_path_factory):
    """Return a Chromium, driven by selenium; the tests that need it are skipped where one of the two is missing."""
    webdriver = pytest.importorskip('selenium.webdriver', reason='no selenium: the page is not tested in a browser')
    from selenium.common.exceptions import WebDriverException
    program = next(filter(None, map(shutil.which, ('chromium', 'chromium-browser', 'google-chrome'))), None)
    driver = shutil.which('chromedriver')
    if not program or not driver:
        pytest.skip('no chromium and chromedriver: the page is not tested in a browser')
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for argument in ('headless=new', 'no-sandbox', 'disable-gpu', 'disable-quic', 'no-first-run', 'disable-sync',
                     'disable-background-networking', 'disable-component-update', 'disable-dev-shm-usage',
                     'window-size=1280,800', f'user-data-dir={tmp_path_factory.mktemp("chromium")}'):
        options.add_argument(f'--{argument}')
    options.set_capability('goog:loggingPrefs', {'browser': 'ALL'})
    try:
        opened = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    except WebDriverException as error:   # as on a machine that lets no browser run
        pytest.skip(f'{program} does not start, the page is not tested in a browser: {error.msg}')
    try:
        yield opened
    finally:
        opened.quit()
