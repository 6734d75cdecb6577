"""Speed and lateness, beside a peer in the same run."""
