"""One viser server; for every test a fresh scene on it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import viser

from robot.configuration import Configuration
from server import configuration_file
from server.scene.view import SceneView
from tests.server.scene.stage import Link, Recorder, until
from tests.server.scene.viser_browser import ViserBrowser


@pytest.fixture(scope="module")
def configuration() -> Configuration:
    return configuration_file.load()


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    running = viser.ViserServer("127.0.0.1", 0, verbose=False)
    yield running
    running.stop()


@pytest.fixture
def link(configuration: Configuration) -> Recorder:
    return Recorder(configuration)


@pytest.fixture
def view(
    server: viser.ViserServer, configuration: Configuration, link: Link
) -> Iterator[SceneView]:
    server.scene.reset()
    server.gui.reset()
    scene = SceneView(server, configuration, link)
    yield scene
    scene.stop()


@pytest.fixture
def browser(server: viser.ViserServer, view: SceneView) -> Iterator[ViserBrowser]:
    before = len(server.get_clients())
    connected = ViserBrowser(server.get_port())
    until(lambda: len(server.get_clients()) == before + 1)
    yield connected
    connected.close()
    until(lambda: len(server.get_clients()) == before)
