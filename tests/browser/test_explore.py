"""A reader's way through notebook 30: JupyterLab in headless Chromium, all cells run, a slider moved."""

import base64
import io
import json
import os
import secrets
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from pumplib import explore
from pumplib.paths import NOTEBOOKS, ROOT

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed", exc_type=ImportError)

NAME = "30_explore_bench"
FLAGS = [
    *("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"),
    *("--disable-sync", "--no-first-run", "--disable-dev-shm-usage"),
]
PATIENCE = 60.0  # s that any one condition may take on a busy machine
# bytes of the picture as the browser has them; the address alone changes with every message
PICTURE = """async () => {
  const image = document.querySelector('img.widget-image');
  if (!image || !image.complete || !image.naturalWidth) return '';
  const bytes = new Uint8Array(await (await fetch(image.src)).arrayBuffer());
  let text = '';
  for (const one of bytes) text += String.fromCharCode(one);
  return btoa(text);
}"""
# JupyterLab calls a kernel idle before the page is connected to it, and loses what is run then: ask its own objects.
IDLE = """async () => {
  const panel = window.jupyterapp?.shell.currentWidget, session = panel?.sessionContext;
  if (!session) return false;
  await Promise.all([window.jupyterapp.restored, panel.revealed, panel.context.ready, session.ready]);
  const kernel = session.session?.kernel;
  if (!kernel) return false;
  await kernel.info;
  return kernel.connectionStatus === 'connected' && kernel.status === 'idle' && !kernel.hasPendingInput;
}"""
STARTED = """() => !document.querySelector('.jp-CodeCell .jp-InputPrompt')?.innerText.includes('[ ]')"""
WRONG = ", ".join(f"[data-mime-type='application/vnd.jupyter.{kind}']" for kind in ("error", "stderr"))


@dataclass
class Server:
    """A running JupyterLab."""

    url: str
    token: str
    process: subprocess.Popen
    log: Path

    def tail(self) -> str:
        return self.log.read_text(errors="replace")[-3000:]


def environment(folder: Path) -> dict[str, str]:
    """Nothing of the user's settings is read, nothing is written outside of the folder."""
    env = {key: value for key, value in os.environ.items() if not key.startswith(("JUPYTER", "PUMPLIB_RUN"))}
    for name in ("CONFIG", "RUNTIME", "DATA"):
        env[f"JUPYTER_{name}_DIR"] = str(folder / name.lower())
    env["IPYTHONDIR"] = str(folder / "ipython")
    run = folder / "run"
    run.mkdir()
    # the notebook's claims and figures go to the folder as well
    told = {"notebook": NAME, "root": str(folder), "package": str(ROOT / "pumplib"), "counts": False}
    (run / "run.json").write_text(json.dumps(told), encoding="utf-8")
    env["PUMPLIB_RUN"] = str(run)
    return env


@pytest.fixture
def server(chromium: str, tmp_path: Path) -> Iterator[Server]:
    explore.bench_view()  # the kernels are compiled before the clock of the browser runs
    (tmp_path / "notebooks").mkdir()
    shutil.copy(NOTEBOOKS / f"{NAME}.ipynb", tmp_path / "notebooks")
    pages = tmp_path / "config" / "labconfig"
    pages.mkdir(parents=True)
    # asks for news on the internet
    off = {"disabledExtensions": {"@jupyterlab/apputils-extension:announcements": True}}
    (pages / "page_config.json").write_text(json.dumps(off), encoding="utf-8")
    token = secrets.token_hex(16)
    log = tmp_path / "server.log"
    command = [
        *(sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", "--ip=127.0.0.1", "--port=0"),
        *(f"--ServerApp.root_dir={tmp_path / 'notebooks'}", "--LabApp.extension_manager=readonly"),
        "--LabApp.expose_app_in_browser=True",
        "--LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate",
    ]
    with log.open("w") as out:
        process = subprocess.Popen(
            command,
            env={**environment(tmp_path), "JUPYTER_TOKEN": token},  # not on the command line, where all can read it
            cwd=tmp_path,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=subprocess.STDOUT,
        )
    try:
        running = Server(url="", token=token, process=process, log=log)
        running.url = wait_for_address(running, tmp_path / "runtime")
        yield running
    finally:
        process.terminate()  # stops the kernels as well
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def wait_for_address(server: Server, runtime: Path) -> str:
    """The server writes its address down once it listens."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if server.process.poll() is not None:
            pytest.fail(f"JupyterLab ended with {server.process.returncode}:\n{server.tail()}")
        for path in runtime.glob(f"jpserver-{server.process.pid}.json"):
            try:
                return str(json.loads(path.read_text(encoding="utf-8"))["url"])
            except (ValueError, KeyError):
                pass  # half written
        time.sleep(0.05)
    pytest.fail(f"JupyterLab does not start:\n{server.tail()}")


@pytest.fixture
def page(chromium: str, server: Server) -> Iterator[Any]:
    with sync_api.sync_playwright() as playwright:
        # every start has a profile folder of its own
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        try:
            # high enough for the whole notebook: JupyterLab leaves out what is far from the screen
            page = browser.new_page(viewport={"width": 1300, "height": 3600})
            page.set_default_timeout(1e3 * PATIENCE)
            yield page
            if shot := os.environ.get("PUMPLIB_SCREENSHOT"):
                page.screenshot(path=shot)
        finally:
            browser.close()


def until(page: Any, script: str, argument: Any = None, patience: float = PATIENCE) -> Any:
    """What the script returns as soon as that is true; playwright's own waiting takes a promise for true."""
    end = time.monotonic() + patience
    while not (found := page.evaluate(script, argument)):
        if time.monotonic() > end:
            raise sync_api.TimeoutError(f"not within {patience:g} s: {script}")
        page.wait_for_timeout(50)
    return found


def picture(page: Any, other_than: bytes = b"") -> bytes:
    """The picture as soon as there is one that differs from the one given."""
    old = base64.b64encode(other_than).decode()
    now = f"async (old) => {{ const now = await ({PICTURE})().catch(() => ''); return now !== old && now; }}"
    return base64.b64decode(until(page, now, old))


def settled(page: Any) -> bytes:
    """The picture once the kernel has answered everything."""
    until(page, IDLE)
    return picture(page)


def run_all(page: Any) -> None:
    """Run all cells by the menu; again if JupyterLab has lost the order, as it may while it is starting."""
    for patience in (5.0, 10.0, PATIENCE):
        page.click(".lm-MenuBar-item:has-text('Run')")
        page.click("li.lm-Menu-item[data-command='runmenu:run-all']")
        try:
            until(page, STARTED, patience=patience)
            return
        except sync_api.TimeoutError:
            until(page, IDLE)
    pytest.fail("JupyterLab does not run the cells")


def difference(a: bytes, b: bytes) -> float:
    first, second = imread(io.BytesIO(a)), imread(io.BytesIO(b))
    return float(np.sqrt(np.mean((first - second) ** 2)))


def test_a_moved_slider_changes_the_picture(server: Server, page: Any) -> None:
    begin = time.perf_counter()
    page.goto(f"{server.url}lab/tree/{NAME}.ipynb?token={server.token}")
    page.wait_for_selector(".jp-Notebook .jp-CodeCell")
    until(page, IDLE)

    run_all(page)
    page.wait_for_selector(f".noUi-handle, {WRONG}")
    assert page.locator(WRONG).all_inner_texts() == []
    first = settled(page)
    assert page.locator(WRONG).all_inner_texts() == []
    prompts = [text.strip() for text in page.locator(".jp-CodeCell .jp-InputPrompt").all_inner_texts()]
    numbers = [int(text.strip("[]:")) for text in prompts]
    assert numbers == sorted(set(numbers))
    assert len(numbers) == 5
    assert page.locator(".jp-RenderedImage img").count() == 1  # the saved figure, above the sliders

    handles = page.locator(".noUi-handle")
    assert handles.count() == 4  # size, valve, speed, noise
    readout = page.locator(".widget-readout").first
    assert readout.inner_text() == "1.00"
    handles.first.focus()
    page.keyboard.press("ArrowRight")
    second = picture(page, other_than=first)
    assert readout.inner_text() == "1.05"
    assert difference(first, second) > 1e-3

    # back where it was the picture is the same again: it depends on the sliders and on nothing else
    page.keyboard.press("ArrowLeft")
    assert picture(page, other_than=second) == first

    page.locator(".widget-dropdown select").select_option("friction")
    assert difference(first, picture(page, other_than=first)) > 1e-2
    until(page, IDLE)
    assert not list(server.log.parent.glob("notebooks/*.png"))
    print(f"[browser: {time.perf_counter() - begin:.1f} s]")
