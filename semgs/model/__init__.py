"""The network: from views to dual Gaussians."""
