"""Gappy functional principal component analysis of drag and of CAS."""
