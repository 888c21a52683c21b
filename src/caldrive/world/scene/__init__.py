"""What stands in a town and how it looks: meshes and textures as arrays."""
