"""What a busy console carries: stream clients and a browser. Runs as a process of its own.

It says on stdout when all are attached, and ends when its stdin closes, with what was received.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import shutil
import sys
import time
from typing import Any

import websockets

_STREAM = "/api/v1/robots/instrument/stream?rate_hz=30"
_SCENE_S = 90.0
_CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--disable-quic",
    "--disable-accelerated-2d-canvas",
)


class Load:
    """The clients and the browser of one console.

    Args:
        base: address of the console, without a slash at its end.
        token: the console's token.
    """

    def __init__(self, base: str, token: str) -> None:
        self._base, self._token = base, token
        self.messages = 0
        self.attached = asyncio.Semaphore(0)

    async def client(self) -> None:
        """Receive states until cancelled."""
        address = self._base.replace("http", "ws", 1) + _STREAM
        headers = {"Authorization": f"Bearer {self._token}"}
        async with websockets.connect(address, additional_headers=headers) as stream:
            await stream.recv()
            self.attached.release()
            async for _ in stream:
                self.messages += 1

    async def browser(self, stack: contextlib.AsyncExitStack) -> dict[str, Any]:
        """Open the page and wait until the scene is drawn; tells how long that took, or why not."""
        try:
            from playwright.async_api import Error, async_playwright
        except ImportError:
            return {"browser": "none: playwright is not installed (./keyhole test installs it)"}
        playwright = await stack.enter_async_context(async_playwright())
        named = os.environ.get("KEYHOLE_CHROMIUM")
        path = named or next(filter(None, map(shutil.which, _CHROMIUM)), None)
        sandbox = [] if os.geteuid() else ["--no-sandbox"]
        try:
            browser = await playwright.chromium.launch(
                executable_path=path, args=[*sandbox, *_FLAGS]
            )
            stack.push_async_callback(browser.close)
            page = await browser.new_page(viewport={"width": 1280, "height": 800})
            began = time.monotonic()
            await page.goto(f"{self._base}/?token={self._token}")
            canvas = page.frame_locator("iframe").locator("canvas").first
            await canvas.wait_for(timeout=_SCENE_S * 1e3)
        except Error as error:
            return {"browser": f"none: {str(error).splitlines()[0]}"}
        seconds = round(time.monotonic() - began, 2)
        return {"browser": f"chromium {browser.version}", "scene_shown_s": seconds}


async def _run(arguments: argparse.Namespace) -> None:
    load = Load(arguments.base, sys.stdin.readline().strip())
    async with contextlib.AsyncExitStack() as stack, asyncio.TaskGroup() as group:
        clients = [group.create_task(load.client()) for _ in range(arguments.clients)]
        for _ in clients:
            await load.attached.acquire()
        told: dict[str, Any] = {"clients": len(clients)}
        told.update(await load.browser(stack))
        print(json.dumps(told), flush=True)
        began, before = time.monotonic(), load.messages
        await asyncio.to_thread(sys.stdin.read)
        elapsed = time.monotonic() - began
        for client in clients:
            client.cancel()
    rate = (load.messages - before) / elapsed / max(1, len(clients))
    print(json.dumps({"messages_per_client_per_s": round(rate, 1)}), flush=True)


def main() -> None:
    """``python -m benchmarks.console_load --base URL --clients N``, token on stdin."""
    parser = argparse.ArgumentParser(prog="keyhole load")
    parser.add_argument("--base", required=True)
    parser.add_argument("--clients", type=int, required=True)
    asyncio.run(_run(parser.parse_args()))


if __name__ == "__main__":
    main()
