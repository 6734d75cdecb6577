"""Every test of the project, in folders that mirror the packages."""
