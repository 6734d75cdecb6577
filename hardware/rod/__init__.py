"""A simulated tendon-driven rod with friction, torsion and contact: the truth for shape sensing.

It shares nothing with the estimators: the curvature is whatever the balance of moments makes it,
found by integrating the rod and shooting at its tip.
"""
