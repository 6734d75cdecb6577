"""One real console for all tests of the web process, and the people who use it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.configured import LATE_LEADERS, LATE_TICKS, configured
from tests.server.api_client import ApiClient
from tests.server.console_process import ConsoleProcess


@pytest.fixture(scope="session")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ConsoleProcess]:
    """Supervisor, control and web, running; patient with leaders, for the machine may be busy."""
    folder = tmp_path_factory.mktemp("console")
    patient = configured(folder, LATE_TICKS, LATE_LEADERS)
    with ConsoleProcess(folder, *patient, "--plant", "kinematic") as running:
        running.wait_until_running()
        yield running


@pytest.fixture
def watcher(console: ConsoleProcess) -> Iterator[ApiClient]:
    """Has the token and no lease."""
    client = ApiClient(console)
    yield client
    client.close()


@pytest.fixture
def operator(console: ConsoleProcess) -> Iterator[ApiClient]:
    """Holds the lease of a disabled robot with the settings of the configuration."""
    client = ApiClient(console)
    client.take()
    yield client
    client.take_when_free()
    client.call("POST", "/reset")
    client.call("POST", "/disable")
    client.done("DELETE", "/path")
    client.done("PUT", "/priority", {"case": "1", "solver": "hqp", "coordinates": "uv"})
    as_configured = {
        "motion_scale": 1.0,
        "lock_rotation": False,
        "lock_translation": False,
        "alignment": "relative",
        "hold_to_move": False,
        "view_wxyz": [1.0, 0.0, 0.0, 0.0],
    }
    client.done("PUT", "/teleoperation", as_configured)
    client.done("DELETE", "/lease")
    client.close()


@pytest.fixture
def driver(operator: ApiClient) -> ApiClient:
    """Holds the lease of an enabled robot."""
    operator.done("POST", "/enable")
    return operator
