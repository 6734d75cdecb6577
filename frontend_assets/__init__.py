"""What the browser is given: the operator page, the URDF and the meshes."""
