"""Studies: many headless runs on all cores or a cluster, resumable."""
