"""The methods that resolve the redundancy of two arms, one a module, behind one interface."""
