"""Everything with a wire, or a simulated wire, behind the interfaces Plant and Leader."""
