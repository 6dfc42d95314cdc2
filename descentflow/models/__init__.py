"""Latent densities over the weights: Gaussian, Gaussian mixture and masked affine flow."""
