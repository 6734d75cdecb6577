"""Headers that tell the browser what each page may do."""

from __future__ import annotations

_COMMON = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Frame-Options": "SAMEORIGIN",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=(), payment=(), usb=()",
}
_CLOSED = "default-src 'none'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"


def _own_page(connect: str) -> str:
    return (
        f"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
        f"font-src 'self'; connect-src 'self' {connect}; frame-src 'self'; manifest-src 'self'; "
        "frame-ancestors 'self'; base-uri 'none'; form-action 'self'"
    )


def _scene(connect: str) -> str:
    """The viser client is one file with inline parts, which unpacks workers and WebAssembly."""
    return (
        "default-src 'none'; "
        "script-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:; "
        "worker-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; "
        f"img-src 'self' data: blob:; font-src 'self' data:; media-src blob: data:; "
        f"connect-src 'self' {connect} blob: data:; "
        "frame-ancestors 'self'; base-uri 'none'; form-action 'none'"
    )


def _documentation(connect: str) -> str:
    """Swagger UI sets styles on its elements."""
    return _own_page(connect).replace("style-src 'self'", "style-src 'self' 'unsafe-inline'")


def headers_for(path: str, host: str = "") -> dict[str, str]:
    """Security and cache headers of the answer to a request for ``path``.

    Args:
        path: path of the request.
        host: its checked Host header: not every browser counts WebSockets of the same host as
            ``'self'``.
    """
    connect = f"ws://{host} wss://{host}" if host else ""
    if path.startswith("/viser"):
        policy = _scene(connect)
    elif path.startswith("/docs"):
        policy = _documentation(connect)
    elif path.startswith("/api/"):
        policy = _CLOSED
    else:
        policy = _own_page(connect)
    cache = "no-store" if path.startswith("/api/") else "no-cache"
    return {**_COMMON, "Content-Security-Policy": policy, "Cache-Control": cache}
