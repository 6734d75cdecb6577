"""The report: the paper's experiments on the simulated robot, as one page that stands alone."""
