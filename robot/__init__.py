"""Models and control as plain functions on numpy arrays: no clocks, files, threads or sockets."""
