"""The gateway's page in a real browser: bands move, what is wrong is named, restarts are survived without a reload."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from gateway_process import Gateway
from headless_browser import Page, browser
from live_mesh import LiveMesh
from ports import free_port
from waiting import until

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(browser() is None, reason="no Chromium here (Debian: apt-get install chromium-headless-shell)"),
]
TOPICS = ("fused", "health")
STEP = "Number(document.querySelector('[data-state=x1] [data-estimator=main]')?.dataset.step ?? 0)"
DRAWN = "document.querySelector('[data-state=x1] canvas').toDataURL()"
OF_BOX = "document.querySelector('[data-peer=box]')"
PROBLEMS = "document.getElementById('problem-list').innerText"


@pytest.fixture
def page() -> Iterator[Page]:
    with Page() as opened:
        yield opened


def gateway_of(mesh: LiveMesh, folder: Path, port: int) -> Gateway:
    configuration = mesh.configuration
    arguments = ["-c", str(configuration.path), "-X", f"network.entry={configuration.network.entry}"]
    return Gateway(folder, arguments, port)


def bands_move(page: Page) -> None:
    """The numbers go on and the drawing is another one."""
    page.until(f"{STEP} > 0", 60)
    step, drawn = page.value(STEP), page.value(DRAWN)
    page.until(f"{STEP} > {step} + 10", 30)
    assert page.value(DRAWN) != drawn


def redness(page: Page, element: str) -> float:
    """By how much the ground of an element is redder than green."""
    text = page.value(f"getComputedStyle({element}).backgroundColor")
    red, green, *_ = [float(part) for part in text.partition("(")[2].rstrip(")").split(",")]
    return red - green


def test_bands_move_and_a_killed_filter_turns_red(page: Page, tmp_path: Path) -> None:
    with LiveMesh(tmp_path, topics=TOPICS) as mesh, gateway_of(mesh, tmp_path, free_port()) as gateway:
        page.open(gateway.url)
        bands_move(page)
        page.until(f"{PROBLEMS} === 'Nothing is wrong.'", 60)
        assert page.value("document.querySelectorAll('figure canvas').length") == 3
        assert page.value(f"{OF_BOX}.dataset.level") == "OK"
        assert redness(page, OF_BOX) < 10

        mesh.process("box").kill()
        page.until(f"{OF_BOX}.dataset.level === 'STALE'", 5)
        assert "gone" in page.value(f"{OF_BOX}.innerText")
        assert "filter box (gone): left the mesh" in page.value(PROBLEMS)
        for scheme in ("light", "dark"):
            page.prefer(scheme)
            assert redness(page, OF_BOX) > 20, scheme
        assert page.value("document.getElementById('problem-list').getAttribute('aria-live')") == "polite"

        until(lambda: mesh.supervisor.watch(time.monotonic()) == [], "it is started again")
        page.until(f"{OF_BOX}.dataset.level === 'OK'", 60)
        page.until(f"{PROBLEMS} === 'Nothing is wrong.'", 60)
        assert page.complaints == []


def test_without_a_mesh_it_is_said_and_choices_are_made_by_keyboard(page: Page, demo: Path, tmp_path: Path) -> None:
    entry = f"tcp/127.0.0.1:{free_port()}"
    with Gateway(tmp_path, ["-c", str(demo), "-X", f"network.entry={entry}"]) as gateway:
        page.open(gateway.url)
        page.until(f"{PROBLEMS}.includes('connected to nobody, trying {entry}')")
        page.until("document.querySelectorAll('figure').length === 3")
        page.press("Tab", 9)
        assert page.value("document.activeElement.className") == "skip"
        page.press("Tab", 9)
        assert page.value("document.activeElement.value") == "main"
        page.press(" ", 32)
        assert page.value("document.activeElement.checked") is False
        page.value("document.querySelector('input[name=state][value=x2]').focus()")
        page.press(" ", 32)
        page.until("document.querySelectorAll('figure').length === 2")
        page.open(gateway.url)
        page.until("document.querySelectorAll('figure').length === 2")
        assert not page.value("document.querySelector('input[value=main]').checked"), "the choice is kept"
        assert page.complaints == []


def test_the_page_survives_a_restart_of_the_gateway_and_of_the_mesh(page: Page, tmp_path: Path) -> None:
    port, folders = free_port(), [tmp_path / name for name in ("first", "second")]
    for folder in folders:
        folder.mkdir()
    with LiveMesh(folders[0], topics=TOPICS) as mesh:
        entry = mesh.configuration.network.entry
        with gateway_of(mesh, tmp_path, port) as gateway:
            page.open(gateway.url)
            bands_move(page)
            page.value("window.isTheSamePage = true")
        page.until("document.getElementById('connection').dataset.state === 'lost'", 10)
        assert "The gateway does not answer" in page.value(PROBLEMS)
        assert page.value(f"getComputedStyle({OF_BOX}.closest('table')).opacity") < "1", "old states are faded"
        second = gateway_of(mesh, tmp_path, port)
        second.__enter__()
        page.until("document.getElementById('connection').dataset.state === 'live'", 10)
        bands_move(page)
        reached = page.value(STEP)
    try:
        page.until(f"{OF_BOX}.dataset.level === 'STALE'", 10)
        page.until(f"{PROBLEMS}.includes('connected to nobody, trying {entry}')", 15)
        with LiveMesh(folders[1], [f"network.entry={entry}"], topics=TOPICS):
            page.until(f"{STEP} > 0 && {STEP} < {reached}", 60)
            bands_move(page)
            page.until(f"{OF_BOX}.dataset.level === 'OK'", 60)
            page.until(f"{PROBLEMS} === 'Nothing is wrong.'", 60)
            assert page.value("window.isTheSamePage") is True
    finally:
        second.__exit__(None, None, None)
