"""Collections of furniture meshes and images that rooms can use."""
