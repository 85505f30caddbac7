"""A reconstructed scene, without any network: Gaussians with their depth, views and file."""
