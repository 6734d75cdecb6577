"""The web process: the API, the page, access, the stream, and the way to viser."""
