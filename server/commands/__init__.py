"""The subcommands of ``keyhole``: a module each, with ``add_parser`` and ``execute``."""
